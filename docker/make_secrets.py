"""Makes the secrets that compose.yml hands to its services; run it as `python3 docker/make_secrets.py`.

Random ones, as files in docker/secrets, which nobody else on this machine can enter. What is there already is kept, so
the program can be run again when a file was deleted to be made anew; files that have to agree are made together.
"""

from __future__ import annotations

import json
import secrets
import sys
from pathlib import Path

FOLDER = Path(__file__).parent / "secrets"
BUCKET = "meshes"
ACTIONS = ("Read", "Write", "List", "Tagging")
"""What the servers may do in the bucket, and nothing elsewhere."""


def database() -> dict[str, str]:
    """The password of PostgreSQL, and the address with it."""
    password = secrets.token_urlsafe(32)
    return {"postgres_password": password, "database": f"postgresql://meshtide:{password}@database/meshtide"}


def store() -> dict[str, str]:
    """The key of the S3 server, once for each side of it."""
    name, key = f"meshtide-{secrets.token_hex(4)}", secrets.token_urlsafe(32)
    identity = {
        "name": "meshtide",
        "credentials": [{"accessKey": name, "secretKey": key}],
        "actions": [f"{action}:{BUCKET}" for action in ACTIONS],
    }
    return {
        "s3_identities": json.dumps({"identities": [identity]}, indent=1),
        "s3_credentials": f"[default]\naws_access_key_id = {name}\naws_secret_access_key = {key}",
    }


def tokens() -> dict[str, str]:
    """One token for writing."""
    return {"write_tokens": secrets.token_urlsafe(32)}


def make(folder: Path) -> list[Path]:
    """Write what is missing; returns which files were written."""
    folder.mkdir(mode=0o700, exist_ok=True)
    written = []
    for group in (database(), store(), tokens()):
        missing = [name for name in group if not (folder / name).exists()]
        if missing and len(missing) < len(group):
            there = ", ".join(sorted(group.keys() - set(missing)))
            sys.exit(f"{folder} has {there}, but not {', '.join(missing)}, which has to agree; delete or restore both")
        for name in missing:
            path = folder / name
            path.write_text(group[name] + "\n", encoding="utf-8")
            path.chmod(0o644)  # the services run as other users; the folder keeps everybody else out
            written.append(path)
    return written


if __name__ == "__main__":
    for made in make(FOLDER):
        print(f"made {made}")
