"""The tab Match: scenario, policies, seed."""

from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.live.match import SEED_RANGE, Match, Setting
from warp_torchrl.live.panel.tab import Tab, chosen_option
from warp_torchrl.runs.config.compose import option_names
from warp_torchrl.system.shipped import policy_names

_NEED_A_FOLDER = ("attack_landfire", "landfire", "wildland")
_ALONE = "nobody"


class MatchTab(Tab):
    """What is played: only what the page knows, never a path from a browser."""

    title = "Match"

    def make(self) -> None:
        """Make the choices."""
        gui, setting, given = self.gui, self.match.setting, self.page.given
        policies = tuple(dict.fromkeys((*_named(given), *_named(setting), *policy_names(), *HEURISTICS)))
        self._scenario = gui.add_dropdown("Scenario", self._scenarios(), initial_value=self._scenario_of(setting))
        self._policy = gui.add_dropdown("Policy", policies, initial_value=setting.policy)
        self._beside = gui.add_dropdown("Beside it", (_ALONE, *policies), initial_value=setting.beside or _ALONE)
        self._seed = gui.add_number("Seed", initial_value=setting.seed, min=0, max=SEED_RANGE[1], step=1)
        load = gui.add_button("Load", hint="shows this match from its start")
        load.on_click(self.guarded(lambda _: self._load()))

    def _load(self) -> None:
        scenario, policy, beside = (chosen_option(each) for each in (self._scenario, self._policy, self._beside))
        is_given = scenario == self._scenario_of(self.page.given)
        setting = Setting(
            policy=policy,
            beside=None if beside == _ALONE else beside,
            seed=int(self._seed.value),
            overrides=self.page.given.overrides if is_given else (f"scenario={scenario}",),
        )
        self.page.open(Match(setting))

    def _scenarios(self) -> tuple[str, ...]:
        """Return what can be chosen: what the page was started with, and the scenarios that read no file."""
        ready = (name for name in option_names("scenario") if name not in _NEED_A_FOLDER)
        return (self._scenario_of(self.page.given), *ready)

    def _scenario_of(self, setting: Setting) -> str:
        """Return what a setting's scenario is called among ``_scenarios``."""
        if setting.overrides == self.page.given.overrides:
            return " ".join(("as started:", *setting.overrides)) if setting.overrides else "the policy's own"
        return setting.overrides[0].removeprefix("scenario=")


def _named(setting: Setting) -> list[str]:
    return [name for name in (setting.policy, setting.beside) if name is not None]
