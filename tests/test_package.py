"""What an installed wheel holds."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tensegrity import __version__

pytestmark = pytest.mark.unchanged("granular", "pyproject.toml", "README.md", "LICENSE")

ROOT = Path(__file__).parent.parent


def test_wheel_holds_the_three_packages_only(tmp_path):
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", tmp_path]
    source = tmp_path / "source"
    left_out = (".*", "build", "_build", "dist", "*.egg-info", "__pycache__", "output")
    shutil.copytree(ROOT, source, ignore=shutil.ignore_patterns(*left_out))
    subprocess.run([*map(str, pip), str(source)], check=True, timeout=300)
    (wheel,) = tmp_path.glob("*.whl")
    assert wheel.name == f"tensegrity_waves-{__version__}-py3-none-any.whl"
    names = zipfile.ZipFile(wheel).namelist()
    top = {name.split("/")[0] for name in names if ".dist-info" not in name}
    assert top == {"tensegrity", "granular", "derivations"}
    for package in top:
        assert f"{package}/py.typed" in names
    sources = {str(path.relative_to(ROOT)) for path in (ROOT / "tensegrity").rglob("*.[ch]")}
    sources |= {str(path.relative_to(ROOT)) for path in (ROOT / "tensegrity").rglob("*.py")}
    assert "tensegrity/engine/prelude.c" in sources
    assert sources <= set(names)


def test_granular_and_derivations_are_one_module_each_under_both_names():
    import tensegrity.derivations.prism
    import tensegrity.granular.design

    import derivations.prism
    import granular.design

    assert tensegrity.granular.design is granular.design
    assert tensegrity.derivations.prism is derivations.prism
    assert granular.design.__spec__.name == "granular.design"
    with pytest.raises(ImportError, match=r"No module named 'granular\.nothing'"):
        import tensegrity.granular.nothing
