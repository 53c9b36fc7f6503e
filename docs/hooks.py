"""Shows the committed results in the site: `../results/...` in a page links to them.

Links are written as seen from the page's file in the repository, so that they work there too; the
site holds the results one level higher up, inside its root.
"""

import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

SHOWN = ("*/claims.md", "*/checks.md", "*/*.png")
CLAIMS = tuple(f"results/figure{i}/claims.md" for i in (1, 2, 3))
NONE_YET = "# The claims\n\nNo results are committed yet: run `make reproduce`.\n"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the reports and pictures in `results/` to the site."""
    root = Path(config.config_file_path).parent
    for path in sorted(p for pattern in SHOWN for p in (root / "results").glob(pattern)):
        uri = path.relative_to(root).as_posix()
        files.append(File.generated(config, uri, abs_src_path=str(path)))
    for uri in CLAIMS:
        if uri not in files.src_uris:
            files.append(File.generated(config, uri, content=NONE_YET))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Takes one `../` off the links to results."""
    return re.sub(r"\]\(\.\./((?:\.\./)*results/)", r"](\1", markdown)
