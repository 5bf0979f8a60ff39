"""`python -m meshtide_server` with encoders that do what the names of files say; see faulty_encoder."""

from __future__ import annotations

import sys
from pathlib import Path

from meshtide_codec.command_line import run
from meshtide_server.__main__ import app
from meshtide_server.encoding import process as encoder_process

if __name__ == "__main__":
    encoder_process.PROGRAM = (sys.executable, str(Path(__file__).with_name("faulty_encoder.py")))
    run(app)
