"""Names that scenarios and baselines have."""

from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs.config.compose import conf_folder, option_names
from warp_torchrl.runs.config.plugins import conf_folders


def scenarios() -> dict[str, str]:
    """Return what each scenario is about, by its name; those of plug-ins are among them."""
    files = [path for folder in (conf_folder(), *conf_folders()) for path in (folder / "scenario").glob("*.yaml")]
    about = {path.stem: _comment(path.read_text(encoding="utf-8")) for path in files}
    return {name: about.get(name, "") for name in option_names("scenario")}


def baselines() -> dict[str, str]:
    """Return what each baseline does, by its name."""
    return {name: _first_paragraph(kind.__doc__ or "") for name, kind in HEURISTICS.items()}


def _comment(text: str) -> str:
    """Return the comment that a yaml file begins with, below its package."""
    lines = [line for line in text.split("\n") if not line.startswith("# @package")]
    end = next((place for place, line in enumerate(lines) if not line.startswith("#")), len(lines))
    return " ".join(line.lstrip("# ") for line in lines[:end])


def _first_paragraph(text: str) -> str:
    """Return the first paragraph of a docstring, in one line."""
    return " ".join(text.strip().split("\n\n")[0].split())
