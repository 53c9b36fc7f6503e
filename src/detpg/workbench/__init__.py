"""One's own problem: a world or logged data, a controller, a run directory.

In: names or objects of a learner and a world. Out: a run that can be resumed, looked at, exported.
Next: the command line (`detpg.cli`), or the caller.
"""
