"""The command `meshtide`: from the first moment on, Ctrl-C ends it in one line.

Only what the interpreter brings along is imported before Ctrl-C is listened to: half of a start is imports.
"""

from __future__ import annotations

import os
import signal
import sys

_S3_LIBRARY = "obstore"


def main() -> None:
    """Run the command; exits with one of `meshtide_codec.command_line.ExitCode`."""
    listener = signal.getsignal(signal.SIGINT)
    if listener is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave_quietly)
    from meshtide_client.commands.application import build  # noqa: PLC0415 - see above
    from meshtide_client.commands.deferred import deferred  # noqa: PLC0415 - the same
    from meshtide_codec.command_line import run  # noqa: PLC0415 - the same

    application = deferred(build())
    signal.signal(signal.SIGINT, listener)
    try:
        run(application)
    except SystemExit as ending:
        if _S3_LIBRARY in sys.modules:
            _leave_at_once(ending.code)
        raise


def _leave_quietly(number: int, _frame: object) -> None:
    """End the process while it is being put together: nothing has been begun that would have to be undone."""
    sys.stderr.write("meshtide: interrupted\n")
    sys.stderr.flush()
    os._exit(128 + number)


def _leave_at_once(code: str | int | None) -> None:
    """End the process without taking the interpreter apart.

    The threads of the library for S3 may ask for the interpreter while it ends, which aborts the process now and then.
    Files are closed by then, and standard output is written (`command_line.run`).
    """
    sys.stderr.flush()
    os._exit(code if isinstance(code, int) else 0 if code is None else 1)


if __name__ == "__main__":
    main()
