"""Other ways to calibrate with few pours, for `hidden_truths.py`.

Each is a generator of (pours, answer in the unit cube, stated probability or NaN), at budgets that rise. The settings
are those of the sources, or the package's own defaults:

  CMA-ES               one pour a trial, the sum of squared relative deviations; the answer is the mean of its
                       distribution (package cmaes)
  Optuna, GP and TPE   two pours a trial, the same sum; the answer is the best trial, as the package gives it
  GrainLearning        its iterative Bayesian filter: Halton's points first, then draws from a Gaussian mixture of two
                       components with full covariances; effective sample size 30 %, covariance scaled by the targets,
                       as its tutorials have them; one pour a sample; the answer is the mean of the posterior. 40
                       samples an iteration, so that 80 and 120 pours are two and three iterations. Its tutorials
                       draw slices of the mixture instead, which takes minutes an iteration with six parameters
  field's habit        `strategy: response_surface` with two and with three seeds and three factors: 80 and 120 pours

Optuna and GrainLearning are no dependencies of repose. GrainLearning asks for a numpy before 2 and works with a later
one:

    pip install torch --index-url https://download.pytorch.org/whl/cpu
    pip install optuna==5.0.0 tqdm && pip install --no-deps grainlearning==2.0.5
"""

from types import SimpleNamespace

import numpy as np
from cmaes import CMA

from repose.bench.parameters import PARAMETERS
from repose.calibrate.strategies.response_surface import (
    ResponseSurfaceSettings,
    screening,
    surface,
)

GRAINLEARNING_SAMPLES = 40
TRIAL_POURS = 2  # of Optuna


def misses(values, goal):
    """Sum of the squared relative deviations of the mean of some pours."""
    return float(((values.mean(axis=0) / goal.aim - 1) ** 2).sum())


def cma(simulator, goal, targets, config, random, budgets):
    """Answer of CMA-ES."""
    d = goal.space.dimensions
    bounds = np.tile([0.0, 1.0], (d, 1))
    optimizer = CMA(
        np.full(d, 0.5), 0.3, bounds=bounds, seed=int(random.integers(2**31))
    )
    trials = []
    for pour in range(1, max(budgets) + 1):
        point = optimizer.ask()
        trials.append(
            (point, misses(simulator.pour(point[None], 1, random).values[0], goal))
        )
        if len(trials) == optimizer.population_size:
            optimizer.tell(trials)
            trials = []
        if pour in budgets:
            yield pour, np.clip(optimizer.mean, 0, 1), np.nan


def optuna_gp(simulator, goal, targets, config, random, budgets):
    """Answer of Optuna's Gaussian process."""
    import optuna

    sampler = optuna.samplers.GPSampler(seed=int(random.integers(2**31)))
    yield from _optuna(sampler, simulator, goal, random, budgets)


def optuna_tpe(simulator, goal, targets, config, random, budgets):
    """Answer of Optuna's tree-structured Parzen estimator."""
    import optuna

    sampler = optuna.samplers.TPESampler(seed=int(random.integers(2**31)))
    yield from _optuna(sampler, simulator, goal, random, budgets)


def _optuna(sampler, simulator, goal, random, budgets):
    """Answers of a study with one of Optuna's samplers."""
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=sampler)
    names = goal.space.free

    def trial_error(trial):
        point = np.array([trial.suggest_float(name, 0, 1) for name in names])
        return misses(simulator.pour(point[None], TRIAL_POURS, random).values[0], goal)

    for budget in sorted(budgets):
        study.optimize(trial_error, n_trials=budget // TRIAL_POURS - len(study.trials))
        yield budget, np.array([study.best_params[name] for name in names]), np.nan


def grainlearning(simulator, goal, targets, config, random, budgets):
    """Answer of GrainLearning's iterative Bayesian filter."""
    from grainlearning.dynamic_systems import DynamicSystem
    from grainlearning.iterative_bayesian_filter import IterativeBayesianFilter

    d = goal.space.dimensions
    system = DynamicSystem.from_dict(
        {
            "param_names": list(goal.space.free),
            "param_min": [0.0] * d,
            "param_max": [1.0] * d,
            "num_samples": GRAINLEARNING_SAMPLES,
            "obs_data": [[aim] for aim in goal.aim],
        }
    )
    mixture = {
        "max_num_components": 2,
        "covariance_type": "full",
        "random_state": int(random.integers(2**31)),
    }
    weights = {"ess_target": 0.3, "scale_cov_with_max": True}
    study = IterativeBayesianFilter.from_dict(
        {"Bayes_filter": weights, "sampling": mixture}
    )
    study.initialize(system)
    for pours in range(GRAINLEARNING_SAMPLES, max(budgets) + 1, GRAINLEARNING_SAMPLES):
        system.param_data = study.param_data_list[-1]
        values = simulator.pour(system.param_data, 1, random).values
        system.set_sim_data(values.transpose(0, 2, 1))
        study.solve(system)
        if pours in budgets:
            yield pours, np.clip(system.estimated_params[-1], 0, 1), np.nan


def response_surface(simulator, goal, targets, config, random, budgets):
    """Answer of `strategy: response_surface`: screening, steepest ascent, Box-Behnken design."""
    for budget, seeds in zip(sorted(budgets), (2, 3), strict=True):
        space = goal.space
        section = ResponseSurfaceSettings(
            **config["response_surface"] | {"most_factors": 3}
        )
        study = SimpleNamespace(
            parameters=space,
            targets=targets,
            settings=SimpleNamespace(response_surface=section),
        )

        def poured(table, seeds=seeds, space=space):
            unit = space.unit(table[list(PARAMETERS)].to_numpy(float))
            means = simulator.pour(unit, seeds, random).means
            return table[["sample", *PARAMETERS]].assign(
                status="ok", **dict(zip(targets.names, means.T, strict=True))
            )

        first = screening.make_screening_samples(space, section)
        corners, middle = screening.split_corners_and_centre(first, section.centres)
        data = poured(first)
        models = screening.fit_models(corners, data, targets, "linear")
        centre = (
            data.loc[middle.index, list(targets.names)].to_numpy(float).mean(axis=0)
        )
        kept = screening.choose_factors(models, section)
        path = screening.make_ascent_samples(models, centre, kept, study)
        second = surface.make_surface_samples(
            surface.rank_path_points(path, poured(path), targets), space, section
        )
        models = screening.fit_models(second, poured(second), targets, "quadratic")
        best = surface.find_best_point(models, targets)
        total = seeds * sum(len(table) for table in (first, path, second))
        if total > budget:
            raise ValueError(f"{total} pours; expected at most {budget}")
        yield budget, surface.convert_to_unit_cube(second, best.coded, space)[0], np.nan


METHODS = {
    "Optuna, GP": optuna_gp,
    "Optuna, TPE": optuna_tpe,
    "GrainLearning": grainlearning,
    "field's habit": response_surface,
    "CMA-ES": cma,
}
