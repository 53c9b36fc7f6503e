"""Runs a controller that was exported to ONNX: `python run_onnx.py controller.onnx 0.1 -0.3 2`.

Needs onnxruntime and numpy alone. Gives the action for one observation, in the world's units.
"""

import sys

import numpy as np
import onnxruntime

session = onnxruntime.InferenceSession(sys.argv[1], providers=["CPUExecutionProvider"])
observation = np.array([sys.argv[2:]], np.float32)  # shape (N, d), here of one observation
(actions,) = session.run(["action"], {"observation": observation})
print(*actions[0])
