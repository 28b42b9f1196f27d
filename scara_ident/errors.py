"""What can go wrong, each as one line that says what, where and what to do."""


class ScaraIdentError(Exception):
    """The data or the model cannot give the requested result (exit status 1)."""

    exit_status = 1


class UsageError(ScaraIdentError):
    """The command was called with wrong arguments (exit status 2)."""

    exit_status = 2


class ArgumentError(UsageError, TypeError):
    """A function got an argument of the wrong kind."""


class RobotError(ScaraIdentError):
    """A robot description that cannot be used."""


class NoRobotError(UsageError, RobotError):
    """A robot description that is not there."""


class RecordingError(ScaraIdentError):
    """A recording that cannot be used."""


class MemoryLimit(RecordingError):
    """A recording that takes more memory than is allowed."""


class ProcessEnded(ScaraIdentError):
    """A process of a run that ended before it had answered."""


class LostArm(ScaraIdentError):
    """A simulated arm that leaves all bounds."""


class RegressorMismatch(ScaraIdentError):
    """A batch kernel that does not reproduce Pinocchio's regressor."""


class EstimationError(ScaraIdentError):
    """An estimate that the available information does not determine."""


class PluginWarning(UserWarning):
    """What an installed package adds is left out; the rest works without it."""
