"""Multi-island genetic algorithm: the contact parameters whose predicted pile is the measured one.

Section 3.3 of the paper: 5 islands of 40 in normalised parameters [-1, 1], tournaments of three, arithmetic
crossover, mutation with probability 0.05 and amplitude 0.1, the island's best kept, and sent round the ring
every 10 generations, 870 times. `islands_ga` minimises any function of whole populations inside bounds::

    from repose.search.miga import islands_ga
    result = islands_ga(lambda x: ((x - 1) ** 2).sum(axis=1), bounds=[(-5, 5)] * 6)

`MIGA` is the same by ask and tell, in [-1, 1]; both need numpy alone. `Objective` is Eq. 11-12, `Archive`
collects solutions met on the way; `run` is the workflow's stage around them.

Where the publication is silent, this is what is done here:

crossover
    always; a child is r a + (1 - r) b with one r, uniform in [0, 1], for all its genes; each
    child has two parents of its own, winners of tournaments drawn with replacement inside the
    island
mutation
    each gene by itself, by 0.1 times a standard normal number, then cut to the box
best kept
    the best of an island is copied unchanged into its next generation, in place of one child
migration
    the best of island i replaces the worst of island i + 1, all islands at once, before breeding,
    and stays at home as well
constraints
    fitness is F (Eq. 11) inside the target box and F + 2 + 10 V outside, V being how far the
    responses lie outside in the units of F; F is at most 2 inside, so any feasible point beats
    any other one, and with none the search goes to the nearest
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from repose.core.errors import InputError
from repose.core.files import read_table
from repose.core.parameters import PARAMETERS
from repose.surrogate.bayesian_bp import load, response_function

FEWEST_ROWS = 10  # of feasible.csv, so that validation always has points to choose from
INFEASIBLE = 2.0  # F inside the box, with the target in it, is at most this
PENALTY = 10.0
# Keys of the configuration's section that are arguments of `MIGA`.
OPERATORS = (
    "islands",
    "population",
    "generations",
    "tournament",
    "mutation_probability",
    "mutation_amplitude",
)


class MIGA:
    """Ask for a population, tell its fitness; once each per generation.

    dimensions: genes, each in [-1, 1]. islands, population: islands and individuals on each. generations:
    between two migrations. seed: of numpy's RandomState. Attributes: best (dimensions,), best_fitness,
    generation (told so far), evaluations. Raises ValueError naming a setting that is out of its limits.
    """

    def __init__(
        self,
        dimensions,
        islands=5,
        population=40,
        generations=10,
        tournament=3,
        mutation_probability=0.05,
        mutation_amplitude=0.1,
        seed=2026,
    ):
        least = {"dimensions": 1, "islands": 1, "population": 2, "generations": 1, "tournament": 1}
        for name, limit in (least | {"mutation_amplitude": 0}).items():
            if not locals()[name] >= limit:
                raise ValueError(f"{name} is {locals()[name]!r}; allowed: at least {limit}")
        if not 0 <= mutation_probability <= 1:
            raise ValueError(f"mutation_probability is {mutation_probability!r}; allowed: 0 to 1")
        self.shape = (islands, population, dimensions)
        self.generations, self.tournament = generations, tournament
        self.mutation_probability, self.mutation_amplitude = mutation_probability, mutation_amplitude
        self.random = np.random.RandomState(seed)
        self._first = population * np.arange(islands)[:, None]  # row of each island's first individual
        self._points = self.random.uniform(-1, 1, (islands * population, dimensions))
        self.best, self.best_fitness = None, math.inf
        self.generation = self.evaluations = 0

    def ask(self):
        """The current population (islands * population, dimensions), island after island; not to be
        changed."""
        return self._points

    def tell(self, fitness):
        """Breed the next generation from the fitness (islands * population,) of the current one."""
        islands, population, dimensions = self.shape
        points, fitness = self._points, np.asarray(fitness, dtype=float)
        self.evaluations += len(points)
        if fitness.min() < self.best_fitness:
            self.best, self.best_fitness = points[fitness.argmin()].copy(), float(fitness.min())
        if self.generation % self.generations == 0:
            self._draw()
        step = self.generation % self.generations
        self.generation += 1

        order = self._ranked(fitness)
        if self.generation % self.generations == 0:
            points, fitness = self._migrate(points, fitness, order)
            order = self._ranked(fitness)
        # rank is all a tournament looks at: the winner of three is the smallest of three random ranks
        parents = points[order.take(self._winners[step] + self._first)]
        children = self._cross(parents[:, :population], parents[:, population:], step)
        children += self._mutation[step]
        np.minimum(children, 1.0, out=children)
        np.maximum(children, -1.0, out=children)
        self._keep_best(children, points[order[:, 0]])
        self._points = children.reshape(islands * population, dimensions)

    def _migrate(self, points, fitness, order):
        """Round the ring."""
        return migrate(points, fitness, order)

    def _cross(self, a, b, step):
        """Arithmetic crossover of parents a and b (islands, population, dimensions)."""
        return b + self._share[step] * (a - b)

    def _keep_best(self, children, best):
        """Each island's best (islands, dimensions) in place of its first child."""
        children[:, 0] = best

    def _draw(self):
        """All random numbers of one round at once: a call of the generator costs more than its numbers."""
        islands, population, dimensions = self.shape
        one, random = (self.generations, islands, population), self.random
        ranks = random.randint(population, size=(self.tournament, self.generations, islands, 2 * population))
        self._winners = ranks.min(axis=0)
        self._share = random.uniform(size=(*one, 1))
        mutated = random.uniform(size=(*one, dimensions)) < self.mutation_probability
        self._mutation = np.where(mutated, self.mutation_amplitude * random.normal(size=mutated.shape), 0.0)

    def _ranked(self, fitness):
        """Row numbers (islands, population) of each island's individuals, best first."""
        islands, population, _ = self.shape
        return fitness.reshape(islands, population).argsort(axis=1, kind="stable") + self._first


def migrate(points, fitness, order):
    """Points and fitness after the best of each island has replaced the worst of the next one in the ring.

    order (islands, population): row numbers of each island, best first.
    """
    points, fitness = points.copy(), fitness.copy()
    best, worst_of_next = order[:, 0], np.roll(order[:, -1], -1)
    points[worst_of_next], fitness[worst_of_next] = points[best], fitness[best]
    return points, fitness


@dataclass(frozen=True)
class Minimum:
    """What `islands_ga` found: x (dimensions,), its value fun, nfev evaluations in nit generations, success
    (whether fun is at most target; None without one), and history (nit,), the best value so far after each
    generation."""

    x: np.ndarray
    fun: float
    nfev: int
    nit: int
    success: bool | None
    history: np.ndarray


def islands_ga(objective, bounds, rounds=50, target=None, **settings):
    """Minimise a function of whole populations with `MIGA`; return a `Minimum`.

    objective: (points, dimensions) in the bounds' units to (points,); an infinite value is a point to avoid.
    bounds (dimensions, 2): lowest and highest of each variable. rounds: migrations, so that rounds times
    generations times islands times population points are evaluated. target: a value at which the search ends
    early. settings: those of `MIGA`. Raises ValueError for bounds or settings out of their limits and for an
    objective that returns another shape or no number.
    """
    bounds = np.asarray(bounds, dtype=float)
    if bounds.ndim != 2 or bounds.shape[1] != 2 or not np.isfinite(bounds).all():
        raise ValueError(f"bounds has shape {bounds.shape}; allowed: (dimensions, 2), all finite")
    low, high = bounds.T
    if not (low < high).all():
        raise ValueError(f"bounds is {bounds.tolist()}; allowed: each lowest below its highest")
    if rounds < 1:
        raise ValueError(f"rounds is {rounds!r}; allowed: at least 1")
    miga = MIGA(len(bounds), **settings)
    half_width, history = (high - low) / 2, []

    def in_units(points):
        return np.clip(low + (points + 1) * half_width, low, high)

    for _ in range(rounds * miga.generations):
        fitness = np.asarray(objective(in_units(miga.ask())), dtype=float)
        if fitness.shape != (len(miga.ask()),) or np.isnan(fitness).any():
            raise ValueError(
                f"objective returned shape {fitness.shape} with {np.isnan(fitness).sum()} NaN; "
                f"allowed: ({len(miga.ask())},) without"
            )
        miga.tell(fitness)
        history.append(miga.best_fitness)
        if target is not None and miga.best_fitness <= target:
            break
    if miga.best is None:
        raise ValueError(f"objective is infinite at all {miga.evaluations} points; allowed: finite at one")
    success = None if target is None else miga.best_fitness <= target
    x, evaluations = in_units(miga.best), miga.evaluations
    return Minimum(x, miga.best_fitness, evaluations, miga.generation, success, np.array(history))


class Objective:
    """Eq. 11-12: deviation of the two responses from the target, in widths of the target box.

    low, high (2,): the box, AoR in degrees and Height in mm. target (2,): inside it; its centre (Eq. 12) if
    None.
    """

    def __init__(self, low, high, target=None):
        self.low, self.high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        self.width = self.high - self.low
        self.target = (self.low + self.high) / 2 if target is None else np.asarray(target, dtype=float)

    def __call__(self, responses):
        """F (Eq. 11) and the violation V of the box, both (points,), of responses (points, 2)."""
        scaled = responses / self.width
        F = np.abs(scaled - self.target / self.width).sum(axis=1)
        outside = np.maximum(np.maximum(self.low / self.width - scaled, scaled - self.high / self.width), 0.0)
        return F, outside[:, 0] + outside[:, 1]

    def fitness(self, F, V):
        """What the search minimises: F inside the box, worse than any point of the box outside."""
        return F + (V > 0) * INFEASIBLE + PENALTY * V


class Archive:
    """The best distinct points out of any number met, in bounded memory.

    Two points are distinct when they lie at least `distance` apart, Euclidean in normalised parameters. Kept
    are, best fitness first, points that are distinct from every better one kept. At most `capacity` are kept
    and at most `buffer` wait to be thinned.
    """

    def __init__(self, dimensions, distance, capacity, buffer=20_000):
        self.distance, self.capacity, self.buffer = distance, capacity, buffer
        self.points, self.fitness = np.empty((0, dimensions)), np.empty(0)
        self._waiting, self._n_waiting, self._worst = [], 0, math.inf

    def add(self, points, fitness):
        """Offer points (n, dimensions) with their fitness (n,)."""
        better = fitness < self._worst
        if not better.any():
            return
        points, fitness = points[better], fitness[better]
        for start in range(0, len(points), self.buffer):
            rows = slice(start, start + self.buffer)
            if self._n_waiting + len(points[rows]) > self.buffer:
                self.thin()
            self._waiting.append((points[rows], fitness[rows]))
            self._n_waiting += len(points[rows])

    def thin(self):
        """Take what waits into points (kept, dimensions) and fitness (kept,), best first."""
        points = np.concatenate([self.points, *(p for p, _ in self._waiting)])
        fitness = np.concatenate([self.fitness, *(f for _, f in self._waiting)])
        kept = distinct(points, fitness, self.distance, self.capacity)
        self.points, self.fitness = points[kept], fitness[kept]
        self._waiting, self._n_waiting = [], 0
        # fewer than before are left where a new point came between old ones: then any point may fill the gap
        self._worst = self.fitness[-1] if len(kept) == self.capacity else math.inf


def distinct(points, fitness, distance, most):
    """Rows, best fitness first, of points (n, d) at least distance apart from every better one taken; at most
    most."""
    rows = np.argsort(fitness, kind="stable")
    columns = np.ascontiguousarray(points[rows].T)
    kept = []
    while len(rows) and len(kept) < most:
        kept.append(rows[0])
        apart = ((columns - columns[:, :1]) ** 2).sum(axis=0) >= distance**2
        apart[0] = False
        left = np.flatnonzero(apart)  # twice as fast as the mask itself
        rows, columns = rows[left], columns.take(left, axis=1)
    return np.array(kept, dtype=int)


def search(responses, objective, settings):
    """One whole search: the archive, the rows of history.csv, and how many feasible points were met.

    responses: populations in [-1, 1] (points, 6) to (points, 2). settings: the `miga` section of the
    configuration. The archive keeps five times `solutions`, since a point that is thinned away may lose its
    better neighbour later.
    """
    miga = MIGA(len(PARAMETERS), **{key: settings[key] for key in OPERATORS}, seed=settings["seed"])
    archive = Archive(len(PARAMETERS), settings["distance"], 5 * settings["solutions"])
    history, feasible_met = [], 0
    for round_ in range(1, settings["rounds"] + 1):
        seen = []
        for _ in range(settings["generations"]):
            points = miga.ask()
            F, V = objective(responses(points))
            fitness = objective.fitness(F, V)
            seen.append((points, fitness))
            feasible_met += len(V) - np.count_nonzero(V)
            miga.tell(fitness)
        archive.add(np.concatenate([p for p, _ in seen]), np.concatenate([f for _, f in seen]))
        mean = float(fitness.mean())
        history.append(
            (round_, miga.generation, miga.evaluations, miga.best_fitness, mean, int(feasible_met))
        )
    archive.thin()
    return archive, history, int(feasible_met)


# The workflow's stage


def run(network_json, ranges, target, settings, published_table3_csv, out_dir, support=None):
    """Search and write feasible.csv, intervals.csv, history.csv, summary.json; return the summary.

    ranges: parameter to (low, high). target: aor_deg, height_mm, aor_range_deg, height_range_mm. settings:
    islands, population, rounds, generations, tournament, mutation_probability, mutation_amplitude, solutions,
    distance, seed. feasible.csv: the best distinct feasible solutions; where fewer than 10 were met, the
    nearest others follow, marked in the column `feasible`. support: `repose.surrogate.support.Support` of the samples;
    with it the column `warning` says which solutions lie beyond them. Raises InputError for bad files and for a target
    outside its own box.
    """
    import pandas as pd  # not needed by whoever wants the optimiser alone

    for key, box in (("aor_deg", "aor_range_deg"), ("height_mm", "height_range_mm")):
        if not target[box][0] <= target[key] <= target[box][1]:
            raise InputError("target", key, target[key], f"inside {box} {list(target[box])}")
    published = _published(published_table3_csv)
    low, high = np.array([ranges[name] for name in PARAMETERS], dtype=float).T
    respond = response_function(load(network_json), low, high)
    box = np.array([target["aor_range_deg"], target["height_range_mm"]], dtype=float)
    objective = Objective(box[:, 0], box[:, 1], (target["aor_deg"], target["height_mm"]))
    archive, history, feasible_met = search(respond, objective, settings)

    Y = respond(archive.points)
    F, V = objective(Y)
    n_feasible = min(int(np.count_nonzero(V == 0)), settings["solutions"])
    rows = slice(0, n_feasible if n_feasible >= FEWEST_ROWS else max(FEWEST_ROWS, n_feasible))
    if n_feasible == 0:
        rows = slice(0, settings["solutions"])
    parameters = low + (archive.points[rows] + 1) / 2 * (high - low)
    table = pd.DataFrame(parameters, columns=list(PARAMETERS))
    table.insert(0, "solution", np.arange(1, len(table) + 1))
    table["aor_predicted_deg"], table["height_predicted_mm"] = Y[rows].T
    table["objective"], table["violation"], table["feasible"] = F[rows], V[rows], V[rows] == 0
    table["representative"] = table["solution"] == 1  # best first, so the least total deviation
    if support is not None:
        table["warning"] = support.warnings(parameters)

    summary = {
        "feasible": n_feasible > 0,
        "n_feasible_met": feasible_met,
        "n_solutions": n_feasible,
        "evaluations": history[-1][2],
        "distance": settings["distance"],
        "representative": {
            name: float(table[name].iloc[0])
            for name in (*PARAMETERS, "aor_predicted_deg", "height_predicted_mm", "objective")
        },
        "box_distance": dict(zip(("aor_deg", "height_mm"), _outside(Y[0], box), strict=True)),
        "target_distance": dict(zip(("aor_deg", "height_mm"), _outside(Y[0], objective.target), strict=True)),
        "message": message(Y[0], target, n_feasible, settings),
    }
    if support is not None and table["warning"].iloc[0]:
        summary["message"] += f" Beyond the samples: {table['warning'].iloc[0]}."
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    table.to_csv(out / "feasible.csv", index=False)
    shown = table[table["feasible"]] if n_feasible else table
    _intervals(pd, shown, ranges, published).to_csv(out / "intervals.csv", index=False)
    columns = ["round", "generation", "evaluations", "best_objective", "mean_objective", "feasible_found"]
    pd.DataFrame(history, columns=columns).to_csv(out / "history.csv", index=False)
    (out / "summary.json").write_text(json.dumps(summary, indent=1) + "\n")
    return summary


def message(responses, target, n_feasible, settings):
    """What the search found, in words; responses (2,) are the best solution's."""
    aor, height = responses
    (aor_low, aor_high), (height_low, height_high) = target["aor_range_deg"], target["height_range_mm"]
    box = f"{aor_low:g}-{aor_high:g} deg and {height_low:g}-{height_high:g} mm"
    best = f"predicted {aor:.2f} deg and {height:.2f} mm"
    wanted = f"the target {target['aor_deg']:g} deg and {target['height_mm']:g} mm"
    aor_off, height_off = abs(aor - target["aor_deg"]), abs(height - target["height_mm"])
    off = f"{aor_off:.2f} deg and {height_off:.2f} mm from {wanted}"
    if n_feasible:
        return (
            f"{n_feasible} distinct feasible solutions inside {box}, at least {settings['distance']:g} apart "
            f"in normalised parameters; the best is {best}, {off}."
        )
    beyond = _outside(np.array(responses), np.array([(aor_low, aor_high), (height_low, height_high)]))
    return (
        f"No feasible solution: nothing met inside {box}. The nearest one is {best}: {beyond[0]:.2f} deg and "
        f"{beyond[1]:.2f} mm outside the box, {off}. Everything after this uses the nearest solutions."
    )


def select_for_validation(solutions, count, ranges):
    """The representative and count others spread over the cloud, as rows of solutions with a column `role`.

    Each next one is the solution farthest, in normalised parameters, from those already chosen (Gonzalez
    1985); among feasible ones as long as there are enough. Fewer come back where solutions has fewer rows.
    """
    low, high = np.array([ranges[name] for name in PARAMETERS], dtype=float).T
    if np.count_nonzero(solutions["feasible"]) > count:
        solutions = solutions[solutions["feasible"]]
    points = 2 * (solutions[list(PARAMETERS)].to_numpy(float) - low) / (high - low) - 1
    chosen = [int(np.flatnonzero(solutions["representative"])[0])]
    nearest = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < min(count + 1, len(points)):
        nearest[chosen] = -1.0
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(points - points[chosen[-1]], axis=1))
    picked = solutions.iloc[chosen].copy()
    picked["role"] = ["representative"] + ["spread"] * (len(chosen) - 1)
    return picked


def _outside(responses, limits):
    """How far each response lies outside its interval (2, 2), or from its target (2,), as floats."""
    limits = np.asarray(limits, dtype=float)
    low, high = (limits, limits) if limits.ndim == 1 else limits.T
    return [float(value) for value in np.maximum(np.maximum(low - responses, responses - high), 0.0)]


def _published(path):
    """Table 3 as published, indexed by parameter, or InputError."""
    table = read_table(path, ("parameter", "low", "high", "dispersion_percent"))
    return table.set_index("parameter").reindex(PARAMETERS)


def _intervals(pd, solutions, ranges, published):
    """Table 3: interval and dispersion (width over the range's width) of each parameter, beside the
    published."""
    rows = []
    for name in PARAMETERS:
        low, high = float(solutions[name].min()), float(solutions[name].max())
        dispersion = 100 * (high - low) / (ranges[name][1] - ranges[name][0])
        rows.append(
            (name, low, high, dispersion, *published.loc[name, ["low", "high", "dispersion_percent"]])
        )
    columns = ["variable", "low", "high", "dispersion_percent"]
    return pd.DataFrame(rows, columns=columns + [f"published_{column}" for column in columns[1:]])
