"""Tables of the shape study: particles, piles, combinations beside the published piles, and the choice.

They apply the rule `research.shape.shape_rule`.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.responses import name_derived_column
from repose.calibrate.targets import Target
from repose.measure.further_responses import CALIBRATED_ANGLE
from research.shape import shape_rule
from research.shape.shape_piles import COLUMNS, DENSITY
from research.shape.shape_rule import CELL, COMBINATION

BULK = ("bulk_density_kg_m3", "core_density_kg_m3")
NOISE_COLUMNS = (
    *CELL,
    "response",
    "signal",
    "noise",
    "signal_to_noise",
    "standard_error",
    "sets",
)


def run_columns(targets: Iterable[Target]) -> tuple[str, ...]:
    """Columns of a cell's table of pours: the cell, the targets, angles by every definition, densities."""
    target_names = (
        target.name for target in targets if target.name != CALIBRATED_ANGLE
    )
    labels = ("kind", *CELL, "set", "seed", "status")
    return tuple(
        dict.fromkeys((*labels, *target_names, *COLUMNS.values(), DENSITY, *BULK))
    )


def measured_as(target: Target, definition: str) -> str:
    """Column of the runs that holds a target, if the angle is of the given definition."""
    return COLUMNS[definition] if target.name == CALIBRATED_ANGLE else target.name


class Study:
    """Pours of a study, with the data for their judgement.

    `runs` has the columns of `run_columns`; `abouts` describe the particle of each cell; `published` has ``set`` and
    the published pile of each. Mass and density are those of the measured berry.
    """

    def __init__(
        self,
        runs: pd.DataFrame,
        abouts: Iterable[Mapping[str, Any]],
        published: pd.DataFrame,
        targets: Sequence[Target],
        mass_g: float,
        density_kg_m3: float,
    ) -> None:
        self.runs = runs.assign(set=runs["set"].astype(str))
        self.published = published
        self.targets = list(targets)
        self.density = density_kg_m3
        rows = [shape_rule.particle_row(body, mass_g, density_kg_m3) for body in abouts]
        self.particles = pd.DataFrame(rows).drop_duplicates(
            "particle", ignore_index=True
        )

    def of(self, kind: str) -> pd.DataFrame:
        """Pours of a kind: one of `shape_cells.KINDS`, or the name of a sensitivity."""
        return self.runs[self.runs["kind"] == kind]

    def selection(self) -> dict[str, pd.DataFrame]:
        """Tables of the first pours: ``particles``, ``piles``, ``sets``, ``combinations``, ``finalists``."""
        piles = pile_table(self.of("published"), self.of("bulk"), self.density)
        sets = set_table(self.of("published"), self.published, self.targets)
        combinations = judged(
            combination_table(sets, self.targets), piles, self.particles
        )
        finalists = shape_rule.finalists(combinations, self.particles)
        tables = {
            "particles": self.particles,
            "piles": piles,
            "sets": sets,
            "combinations": combinations,
        }
        return tables | {"finalists": finalists}

    def verdict(
        self, finalists: pd.DataFrame
    ) -> tuple[dict[str, pd.DataFrame], dict[str, Any]]:
        """Tables of the fresh pours, ``fresh``, ``fresh_sets`` and ``noise``, and the choice.

        `finalists` is the table of `selection`.
        """
        noise = noise_table(self.of("design"), self.targets)
        sets = set_table(
            self.runs[self.runs["kind"] != "design"], self.published, self.targets
        )
        sets = sets[~sets["kind"].isin(["published", "bulk"])]
        fresh = with_signal(
            combination_table(sets[sets["kind"] == "fresh"], self.targets),
            noise,
            self.targets,
        )
        fresh["meets"] = [
            shape_rule.meets(row, self.targets) for row in fresh.to_dict("records")
        ]
        fresh = fresh.merge(self._reached(fresh), on=COMBINATION, how="left")
        selected = finalists[[*COMBINATION, "role", "distance"]]
        selected = selected.rename(columns={"distance": "selection_distance"})
        rows = selected.merge(fresh, on=COMBINATION, how="left")
        choice = shape_rule.choice(
            rows.to_dict("records"), self._definitions(rows, fresh)
        )
        choice["rule_sha256"] = shape_rule.sha256()
        return {"fresh": fresh, "fresh_sets": sets, "noise": noise}, choice

    def _reached(self, fresh):
        """For each fresh combination: whether its definition can reach the physical pile."""
        angle = next(
            (target for target in self.targets if target.name == CALIBRATED_ANGLE), None
        )
        height = next(
            (target for target in self.targets if target.name != CALIBRATED_ANGLE), None
        )
        rows = []
        for row in fresh[COMBINATION].to_dict("records"):
            found = {"angle_at_height": math.nan, "reached": False}
            if angle is not None and height is not None:
                design = self.of("design")
                pours = design[
                    np.logical_and.reduce([design[key] == row[key] for key in CELL])
                ]
                names = {COLUMNS[row["definition"]]: "angle", height.name: "height"}
                means = pours.groupby("set")[list(names)].mean().rename(columns=names)
                found = shape_rule.reached(means, angle, height)
            rows.append(row | found)
        return pd.DataFrame(rows, columns=[*COMBINATION, "angle_at_height", "reached"])

    def _definitions(self, rows, fresh):
        """All definitions of the most physical finalist, the nearest of the first pours first."""
        physical = rows[rows["role"] == "physical"]
        if physical.empty:
            return []
        first = set_table(self.of("published"), self.published, self.targets)
        first = combination_table(first, self.targets).merge(physical[CELL], on=CELL)
        order = first.sort_values("distance", kind="stable")[COMBINATION]
        return order.merge(fresh, on=COMBINATION).to_dict("records")


def pile_table(
    piles: pd.DataFrame, bulk: pd.DataFrame, density_kg_m3: float
) -> pd.DataFrame:
    """Share of pours that made a pile, packing inside the piles, and bulk density in the measuring cylinder.

    A row for each cell; the cylinder's numbers are those of its particle. `piles` are pours of the funnel, `bulk` of
    the cylinder.
    """
    rows = []
    for key, group in piles.groupby(CELL, sort=False):
        density, error = _mean(group[DENSITY])
        row = dict(zip(CELL, key, strict=True)) | {
            DENSITY: density,
            "packing": density / density_kg_m3,
        }
        row |= {
            "packing_se": error / density_kg_m3,
            "share_of_piles": float((group["status"] == "ok").mean()),
        }
        poured = bulk[bulk["particle"] == key[0]]
        for column in BULK:
            row[column] = float(poured[column].mean())
        row["cylinder_packing"] = row[BULK[0]] / density_kg_m3
        rows.append(row)
    return pd.DataFrame(rows)


def set_table(
    runs: pd.DataFrame, published: pd.DataFrame, targets: Sequence[Target]
) -> pd.DataFrame:
    """Mean, standard error and difference from the published pile of each cell, definition and parameter set."""
    rows = []
    pairs = published.set_index("set")
    for key, group in runs[runs["set"].isin(pairs.index)].groupby(
        ["kind", *CELL, "set"], sort=False
    ):
        labels = dict(zip(["kind", *CELL, "set"], key, strict=True))
        for definition in COLUMNS:
            row = labels | {"definition": definition}
            for target in targets:
                row[target.name], row[target.response.standard_error] = _mean(
                    group[measured_as(target, definition)]
                )
            for target in targets:
                difference = (
                    row[target.name]
                    - pairs.at[labels["set"], target.response.simulated]
                )
                row[name_derived_column(target.name, "difference")] = difference
            row |= {"n_ok": int((group["status"] == "ok").sum()), "n": len(group)}
            rows.append(row)
    numbers = [
        name
        for target in targets
        for name in (target.name, target.response.standard_error, _off(target))
    ]
    return pd.DataFrame(
        rows, columns=["kind", *CELL, "set", "definition", *numbers, "n_ok", "n"]
    )


def _off(target):
    """Column of the difference from the published pile."""
    return name_derived_column(target.name, "difference")


def combination_table(sets: pd.DataFrame, targets: Sequence[Target]) -> pd.DataFrame:
    """Each combination over all published sets, the nearest first; `sets` is of `set_table`.

    Columns: mean differences with standard errors, the number of sets within the physical pile's standard deviations
    sd_i, and the distance, which is the root of the mean over the sets of the sum of (difference_i / sd_i)^2. In the
    standard errors a set with a single pile counts as much as the others on average.
    """
    rows = []
    for key, group in sets.groupby(COMBINATION, sort=False):
        count = len(group)
        distance = pd.Series(0.0, group.index)
        within = pd.Series(True, group.index)
        row: dict[str, Any] = dict(zip(COMBINATION, key, strict=True))
        for target in targets:
            difference = group[_off(target)]
            row[difference.name] = difference.mean()
            squares = group[target.response.standard_error] ** 2
            row[target.response.standard_error] = (
                math.sqrt(squares.fillna(squares.mean()).sum()) / count
            )
            distance = distance + (difference / target.sd) ** 2
            within = within & (difference.abs() <= target.sd)
        row |= {
            "sets_within": int(within.sum()),
            "sets": count,
            "distance": math.sqrt(distance.mean(skipna=False)),
        }
        rows.append(row)
    numbers = [
        name
        for target in targets
        for name in (_off(target), target.response.standard_error)
    ]
    table = pd.DataFrame(
        rows, columns=[*COMBINATION, *numbers, "sets_within", "sets", "distance"]
    )
    return table.sort_values("distance", ignore_index=True, kind="stable")


def judged(
    combinations: pd.DataFrame, piles: pd.DataFrame, particles: pd.DataFrame
) -> pd.DataFrame:
    """Judge combinations by the rule's criteria of particle and pile, those that fulfil them first."""
    of_piles = ["packing", "packing_se", "share_of_piles"]
    table = combinations.merge(piles[[*CELL, *of_piles]], on=CELL, how="left")
    table = table.merge(
        particles[["particle", "measured_berry"]], on="particle", how="left"
    )
    pairs = table[["packing", "packing_se"]].itertuples(index=False, name=None)
    table["packs_like_a_fruit"] = [
        shape_rule.packs_like_a_fruit(*pair) for pair in pairs
    ]
    flows = table["share_of_piles"] >= shape_rule.LEAST_SHARE_OF_PILES
    fulfils = table["measured_berry"] & table["packs_like_a_fruit"] & flows
    table["eligible"] = fulfils & table["distance"].notna()
    return table.sort_values(
        ["eligible", "distance"], ascending=[False, True], ignore_index=True
    )


def with_signal(
    combinations: pd.DataFrame, noise: pd.DataFrame, targets: Sequence[Target]
) -> pd.DataFrame:
    """Add the signal-to-noise ratio of their angle to combinations.

    It is that of the first target, where the angle is no target.
    """
    with_angle = any(target.name == CALIBRATED_ANGLE for target in targets)
    judged_by = (
        combinations["definition"] if with_angle else targets[0].response.quantity
    )
    columns = {"standard_error": "signal_to_noise_se"}
    ratios = noise.rename(columns=columns)[
        [*CELL, "response", "signal_to_noise", "signal_to_noise_se"]
    ]
    table = combinations.assign(response=judged_by).merge(
        ratios, on=[*CELL, "response"], how="left"
    )
    return table.drop(columns="response")


def noise_table(runs: pd.DataFrame, targets: Sequence[Target]) -> pd.DataFrame:
    """Signal and noise of every definition of the angle and of the other targets, for each cell.

    noise: standard deviation from seed to seed. signal: standard deviation of the true means over the designed
    parameter sets, which is the spread of the sets' means less the part of the noise. The standard error of their ratio
    comes from leaving out one set at a time (jackknife).
    """
    others = [target for target in targets if target.name != CALIBRATED_ANGLE]
    columns = COLUMNS | {target.response.quantity: target.name for target in others}
    rows = []
    for cell, group in runs.groupby(CELL, sort=False):
        for response, column in columns.items():
            # variance, mean and number of the runs of each set that has two or more
            moments = []
            for _, set_runs in group.groupby("set"):
                values = set_runs[column].dropna().to_numpy()
                if len(values) > 1:
                    moments.append((values.var(ddof=1), values.mean(), len(values)))
            sets = np.array(moments).reshape(-1, 3)
            signal, noise = _signal_and_noise(sets)
            left_out = [_ratio(np.delete(sets, k, axis=0)) for k in range(len(sets))]
            spread = (len(sets) - 1) * np.var(left_out) if moments else math.nan
            ratio_se = math.sqrt(spread)
            rows.append(
                (*cell, response, signal, noise, _ratio(sets), ratio_se, len(sets))
            )
    return pd.DataFrame(rows, columns=list(NOISE_COLUMNS))


def _signal_and_noise(sets):
    """Estimate spreads of true means and of single runs, from variance, mean and number of runs of each set."""
    if len(sets) < 3:
        return math.nan, math.nan
    variance, mean, count = sets.T
    within = np.average(variance, weights=count - 1)
    added = within * np.mean(1 / count)
    return math.sqrt(max(np.var(mean, ddof=1) - added, 0.0)), math.sqrt(within)


def _ratio(sets):
    """Signal over noise, NaN without noise."""
    signal, noise = _signal_and_noise(sets)
    return signal / noise if noise else math.nan


def _mean(values):
    """Mean and standard error without missing values; the error of a single value is NaN."""
    values = values.dropna().astype(float)
    mean = float(values.mean()) if len(values) else math.nan
    return mean, float(values.std(ddof=1) / math.sqrt(len(values))) if len(
        values
    ) > 1 else math.nan
