"""`detpg export`: what was learnt, as one file for another machine."""

import dataclasses
from pathlib import Path
from typing import Annotated, Literal

import tyro

from detpg.cli.errors import UserError
from detpg.cli.opened import OwnPolicy, opened, told


@dataclasses.dataclass(frozen=True)
class Export:
    """Writes a run's controller as one file: observation in, action out, in the world's units."""

    run_directory: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="RUN")]
    """Folder of a run."""

    format: Literal["onnx", "jax", "json"] = "onnx"
    """For onnxruntime and others, for JAX, or to read and for NumPy."""

    output: Annotated[
        Path | None,
        tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: controller.FORMAT)"),
    ] = None
    """File to write; one that is there is replaced."""

    policy: Literal["best", "last"] = "best"
    """The one that was evaluated as best, or that of the last step."""

    index: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Which training seed's policy, 0 the first (default: the best evaluated)."""

    own_policy: OwnPolicy = None
    """Policy of your own, if the run was trained with one: code is never loaded from a run."""

    def run(self) -> None:
        """Writes the file, if it answers as the training code does.

        Raises:
            UserError: A run or file that cannot be used, or a controller that the format cannot
                hold; nothing was written.
        """
        from detpg.integrations.export import export

        output = self.output or Path(f"controller.{self.format}")
        found = opened(self.run_directory, self.policy, self.own_policy)
        with told():
            controller = found.controller(self.policy, self.index)
        size = found.spec.observation_size
        try:
            parity = export(controller, size, output, self.format, found.spec)
        except (ValueError, ImportError) as error:
            raise UserError(str(error)) from error
        except OSError as error:
            raise UserError(
                f"{output} cannot be written to ({error.strerror}): choose another --output."
            ) from error
        print(
            f"written to {output}: {output.stat().st_size} bytes; on {parity.num_observations} "
            f"observations within {parity.difference:.1e} half ranges of the training code"
        )
