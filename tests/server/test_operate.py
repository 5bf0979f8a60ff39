"""docs/operate.md against the program."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

from meshtide_server.operations.metrics import REGISTRY
from meshtide_server.settings import Settings

ROOT = Path(__file__).parents[2]
DOCUMENT = (ROOT / "docs" / "operate.md").read_text()


@pytest.fixture
def generator() -> ModuleType:
    specification = importlib.util.spec_from_file_location("settings_table", ROOT / "tools" / "settings_table.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_the_table_of_settings_is_that_of_the_program(generator: ModuleType) -> None:
    assert generator.replaced(DOCUMENT) == DOCUMENT, "run python tools/settings_table.py"
    for name in Settings.model_fields:
        assert f"| `MESHTIDE_{name.upper()}` |" in DOCUMENT


def test_every_metric_is_described() -> None:
    told = set(re.findall(r"`(meshtide_\w+)`", DOCUMENT))
    counted = {
        family.name + ("_total" if family.type == "counter" else "")
        for family in REGISTRY.collect()
        if family.name.startswith("meshtide_")
    }
    assert told == counted
