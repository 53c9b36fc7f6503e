"""What a user can mend."""


class UserError(Exception):
    """Bad input or a place that cannot be used: one sentence, exit code 2, no traceback."""
