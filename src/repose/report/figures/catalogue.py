"""List the figures of a study: what each shows and reads, and what draws it.

The workflow makes a rule of every entry. It reads this list without loading the modules
that draw, or the libraries that these need.
"""

from repose.report.figures.registry import (
    ANSWER_CHECK,
    ANSWER_SAMPLES,
    ANSWER_SOLUTIONS,
    POUR_TRAJECTORY,
    PUBLISHED_HERE,
    PUBLISHED_INTERVALS,
    PUBLISHED_SOLUTIONS,
    SIMULATED_SETS,
    SIZES,
    Drawn,
    has_drum,
    has_grain,
    has_network,
    has_pairs,
    has_pile,
    has_profiles,
)

# Inputs of several figures.
PILE_INPUTS = {
    "heap": "validation/heaps/001.npz",
    "particle": "berry/particle.json",
}  # a pile of the answer
MEASURED_PILE_INPUTS = PILE_INPUTS | {"berry": "berry/berry.json"}
NETWORK_INPUTS = {"network": "network/network.json"}
SURFACE_INPUTS = {
    "samples": "response_surface/surface.csv",
    "dataset": "response_surface/dataset.csv",
}

FIGURES: dict[str, Drawn] = {
    "figure02": Drawn(
        "berries.draw_sizes_and_sphericity",
        title="Figure 2",
        inputs={"sizes": SIZES},
        caption=(
            "Figure 2. How large and how round are the grains? Their sizes, with "
            "the normal curves of their means and standard deviations. Where the "
            "table of sizes says so in its first line, it is a reconstruction from "
            "published statistics and was not measured."
        ),
        when=has_grain,
    ),
    "figure07": Drawn(
        "berries.draw_particle_and_mesh",
        title="Figure 7",
        inputs={"stl": "berry/berry.stl", "particle": "berry/particle.json"},
        caption=(
            "Figure 7. How well does the simulated particle follow the grain? The "
            "mesh of the grain, and each kind of particle made from it, with its "
            "distance from the mesh."
        ),
        reads=("berry", "colour"),
        when=has_grain,
        memory_mb=650,
    ),
    "validation": Drawn(
        "checks.draw_validation",
        title="Table 4, shown",
        inputs={"table4": "validation/table4.csv"},
        optional={"published": PUBLISHED_SOLUTIONS},
        caption=(
            "Table 4 as a figure: do new simulations agree with the predictions, "
            "and do they lie inside the target ranges? Predicted and simulated "
            "responses of the answer, the representative solution, and others, "
            "simulated with seeds that no sample of the design had. Published "
            "solutions have a P before their number; where no simulated value was "
            "published, the figure says so. Bars are one standard error."
        ),
        reads=("targets",),
    ),
    "published": Drawn(
        "checks.draw_published_solutions",
        title="Published solutions here",
        inputs={"published": PUBLISHED_HERE},
        caption=(
            "Do the published parameter sets meet the targets in this simulator? "
            "Their responses as published, and as simulated here, from the stored "
            "table that the configuration names. Bars are one standard error over "
            "the seeds; another draw of seeds moves a mean by about as much."
        ),
        reads=("targets",),
    ),
    "discrepancy": Drawn(
        "discrepancy.draw_information_over_discrepancy",
        title="Discrepancy",
        inputs={"discrepancy": "posterior/discrepancy.csv"},
        caption=(
            "What do the measurements say if the simulator itself is off? "
            "Information of the measurements on the parameters, over the "
            "discrepancy: the error that the simulator has with the best "
            "parameters, too. Above the information; below the 95 % interval of "
            "each parameter in its range. If there is a shape study, the spread of its "
            "plausible models is marked."
        ),
        reads=("parameters", "targets"),
        folder="posterior",
        category="Uncertainty",
    ),
    "definitions": Drawn(
        "measuring.draw_definitions",
        title="Definitions of the angle",
        inputs=MEASURED_PILE_INPUTS,
        caption=(
            "How much does the angle depend on its definition? All definitions on "
            "one pile, the first pour of the representative solution: their lines in "
            "one side view, and the angle that each gives in all views. They differ "
            "from the means over all pours of the check. The sides of a pile differ "
            "because it is of few grains, and lie at other distances from the crest, "
            "which is its single highest grain; the angle of a view is the mean of "
            "both. The study calibrates the "
            "definition {measure[response]}; ``repose docs measurement`` compares "
            "them."
        ),
        reads=("measure",),
        when=has_pile,
    ),
    "noise": Drawn(
        "noise.draw_noise_floor",
        title="Noise floor",
        inputs={
            "runs": "runs.csv",
            "seeds": "noise/seeds.csv",
            "noise": "noise/noise.json",
        },
        caption=(
            "How many seeds does a mean need? Runs of the same parameters and runs "
            "of others, and the standard error that a number of seeds buys. "
            "``noise.json`` has the correlation of the responses within samples."
        ),
        reads=("parameters", "targets"),
        folder="noise",
        category="Uncertainty",
    ),
    "outline": Drawn(
        "outline.draw_outline_and_measurement",
        title="Pile and measurement at one scale",
        inputs=MEASURED_PILE_INPUTS,
        caption=(
            "Does the simulated pile look like the measured one? The outlines of "
            "the first pour of the answer in all views, with their mean, over the "
            "measured numbers at the same scale. Blue and black are simulated: the "
            "outlines, the height, and the slope of this one pile. Orange and red are "
            "measured: the height and the slope, each with the standard deviation of a "
            "repetition. The measurement gives no width, so all lines of the slope are "
            "drawn through the middle of the simulated flanks. The height of a pile is "
            "that of its highest point in each view, which the mean outline does not "
            "reach."
        ),
        reads=("measure", "targets"),
        when=has_pile,
    ),
    "plane": Drawn(
        "plane.draw_planes",
        title="Targets against each other",
        inputs={
            "dataset": ANSWER_SAMPLES,
            "feasible": ANSWER_SOLUTIONS,
            "table4": ANSWER_CHECK,
        },
        if_there={"pool": "pool/dataset.csv", "fresh": "pool/fresh_dataset.csv"},
        caption=(
            "Can the simulated piles meet the targets together, and does the "
            "answer? All samples with their standard errors, and of the pool if it "
            "was poured; the target ranges; the mean of the measured piles with its "
            "standard error; the predictions of the solutions that the search "
            "lists; and the answer, as predicted and as simulated with fresh seeds, "
            "with its standard error. The second panel of each pair enlarges the "
            "target ranges. The solutions lie close together, since the search "
            "aims at the measured means; their span stands below the panel."
        ),
        reads=("targets",),
        when=has_pairs,
    ),
    "corner": Drawn(
        "posterior.draw_posterior",
        title="Posterior",
        inputs={
            "draws": "posterior/draws.csv",
            "posterior": "posterior/posterior.csv",
            "summary": "posterior/posterior.json",
            "feasible": "miga/feasible.csv",
        },
        optional={"published": SIMULATED_SETS},
        caption=(
            "What do the measurements say about the parameters, alone and in pairs? "
            "Draws of the posterior over the prior, with the feasible solutions of "
            "the search. A parameter whose draws fill its range, and a pair whose "
            "cells are white, are not determined by the targets. Published "
            "parameter sets are marked; one of another wall stands in the panels of "
            "two grain-grain parameters alone."
        ),
        reads=("parameters", "targets"),
        folder="posterior",
        category="Uncertainty",
    ),
    "intervals": Drawn(
        "posterior.draw_credible_intervals",
        title="Credible intervals",
        inputs={
            "posterior": "posterior/posterior.csv",
            "feasible": "miga/feasible.csv",
        },
        caption=(
            "Does the pile determine the parameters? The 95 % interval of each free "
            "parameter as a part of its range; one that covers the whole range "
            "determines nothing. The diamond is the answer. At the right the width of "
            "the interval over that before the measurements, and the information in "
            "bits: one bit halves the range. The thin lines span the solutions found and the "
            "published ones; they show where two searches ended, not an uncertainty."
        ),
        reads=("parameters", "targets"),
        folder="posterior",
        category="Uncertainty",
    ),
    "profiles": Drawn(
        "profiles.draw_profiles",
        title="Profiles",
        inputs={"table4": ANSWER_CHECK},
        caption=(
            "Does the answer have the measured profile? The measured heights with "
            "their standard deviation, the profile that is predicted for the "
            "answer, and the profile that is simulated with fresh seeds, with its "
            "standard error. The lines are the smooth profiles of the scores."
        ),
        reads=("targets",),
        when=has_profiles,
    ),
    "region": Drawn(
        "region.draw_region",
        title="Region that is not excluded",
        inputs={
            "region": "posterior/region.csv",
            "summary": "posterior/posterior.json",
        },
        caption=(
            "Which parameters do the measurements exclude? The region of parameters "
            "that the measurements do not exclude (history matching), projected on "
            "each pair of parameters. Above the diagonal the share of parameter sets "
            "still possible (optical depth): those whose misfit is below three, the "
            "number of standard deviations by which the worst response misses its "
            "measurement. Below the diagonal, where a cell is excluded whatever the "
            "other parameters are: the misfit at their best values (minimum "
            "implausibility). Without such a cell these panels are left out."
        ),
        reads=("parameters", "targets"),
        folder="posterior",
        category="Uncertainty",
    ),
    "pareto_surface": Drawn(
        "response_surface.draw_pareto_charts",
        title="Pareto chart of the surface",
        inputs={"effects": "response_surface/surface_effects.csv"},
        caption="Which terms of the surface matter? Standardised effects: single parameters, "
        "products of two, squares.",
        reads=("targets",),
        folder="response_surface",
        category="Response surface",
    ),
    "pareto_screening": Drawn(
        "response_surface.draw_pareto_charts",
        title="Pareto chart of the screening",
        inputs={"effects": "response_surface/screening_effects.csv"},
        caption="Which parameters matter? Standardised effects of the Plackett-Burman "
        "screening. A parameter goes on where its bar passes the dashed line.",
        reads=("targets",),
        folder="response_surface",
        category="Response surface",
    ),
    "perturbation": Drawn(
        "response_surface.draw_perturbation_plots",
        title="Perturbation plot",
        inputs=SURFACE_INPUTS,
        caption=(
            "How does a response change with one parameter alone? Each response "
            "over one parameter after the other, the others at the centre of the "
            "design; grey: the target. Lines end where constraints forbid."
        ),
        reads=("targets", "parameters"),
        folder="response_surface",
        category="Response surface",
    ),
    "contours": Drawn(
        "response_surface.draw_contour_plots",
        title="Contours of the surface",
        inputs=SURFACE_INPUTS | {"optimum": "response_surface/optimum.json"},
        caption=(
            "Where is the target met? Each response over every pair of parameters, "
            "the others at the optimum (star); the black line is the target. What "
            "constraints forbid is left white."
        ),
        reads=("targets", "parameters"),
        folder="response_surface",
        category="Response surface",
    ),
    "figure15": Drawn(
        "rotation.draw_states",
        title="Figure 15",
        inputs={"states": "drum/median.npz", "particle": "berry/particle.json"},
        optional={"runs": "drum/runs.csv"},
        caption=(
            "Figure 15. The bed in the drum before the rotation, before its first "
            "slip and after it, simulated with the representative solution and seen "
            "along the axis; the green line is fitted to the middle "
            "{drum[fit_share]:.3g} of the upper edge, which is that of the highest "
            "grains along the axis. The pictures show the run whose slip angle is the "
            "median of {drum[seeds]} run(s). Does the bed slip as early as in the article? The text below says "
            "how far the drum turned before the slip. The article gives no angle, but "
            "the length of its run, {drum[report_s]:g} s with the filling; the text also "
            "says by what angle the drum has turned by then."
        ),
        reads=("drum", "measure.mm_per_pixel", "colour"),
        when=has_drum,
        memory_mb=550,
    ),
    "drum": Drawn(
        "rotation.draw_course",
        title="The drum over time",
        inputs={
            "record": "drum/record.csv",
            "profile": "drum/profile.csv",
            "runs": "drum/runs.csv",
        },
        caption=(
            "The drum over time: when does the bed slip? a: surface and centre of "
            "mass of every run. A slip is judged when the centre of mass has fallen "
            "by {drum[slip_drop_deg]} degrees below its highest, and began at that "
            "highest; the drum then stops. The article shows the bed after a slip "
            "by the time of the vertical line: {drum[report_s]:g} s from the start "
            "of the filling, less the time before the rotation. b: how far grains moved in the slip, "
            "against the drum, by depth."
        ),
        reads=("drum",),
        when=has_drum,
    ),
    "design": Drawn(
        "samples.draw_design",
        title="Design",
        inputs={"samples": "design/samples.csv"},
        optional={"comparison": "design/comparison.csv"},
        caption=(
            "Do the samples fill the ranges? The design ({design[method]}): every "
            "pair of parameters. Each parameter has one sample in each of "
            "{design[samples]} strata of its range, equal along its scale."
        ),
        reads=("parameters", "design.method"),
    ),
    "dataset": Drawn(
        "samples.draw_responses_over_parameters",
        title="Responses",
        inputs={"dataset": "dataset.csv"},
        caption=(
            "Which parameters move the responses? Responses of the samples over "
            "each parameter, with their rank correlation. The goji berry's angle "
            "falls with the friction between berries: such piles pack more loosely, "
            "and the same berries need a wider foot (``repose docs uncertainty``, "
            "Sensitivity)."
        ),
        reads=("parameters", "targets"),
    ),
    "figure14": Drawn(
        "search.draw_feasible_solutions",
        title="Figure 14",
        inputs={"feasible": "miga/feasible.csv", "summary": "miga/summary.json"},
        optional={"published": PUBLISHED_INTERVALS},
        caption=(
            "Figure 14. Where are the solutions, and where are the published ones? "
            "Solutions that the search met, in the ranges of the parameters, with "
            "the published intervals. Of all feasible points met, the best "
            "{miga[solutions]} are kept that lie at least {miga[distance]} apart in "
            "parameters normalised to [-1, 1]. They are the sets of one search, and "
            "not all sets that agree with the measurements. By default, the answer is "
            "the set with the smallest expected error, which includes how uncertain "
            "each prediction is, so it may lie beside the other sets. Where none was "
            "feasible the nearest ones are shown, and the figure says so."
        ),
        reads=("parameters", "targets"),
    ),
    "sobol": Drawn(
        "sensitivity.draw_sobol_indices",
        title="Sobol indices",
        inputs={"sobol": "sensitivity/sobol.csv"},
        caption=(
            "Which parameters explain the variance of the responses? First-order "
            "and total Sobol indices of each response of the surrogate, with 95 % "
            "bootstrap intervals. With constraints these indices do not exist: then "
            "the bars are the share that a parameter alone explains, and the share "
            "that remains if all others are known."
        ),
        reads=("parameters", "targets"),
        folder="sensitivity",
        category="Uncertainty",
    ),
    "main_effects": Drawn(
        "sensitivity.draw_main_effects",
        title="Main effects",
        inputs={
            "sobol": "sensitivity/sobol.csv",
            "effects": "sensitivity/main_effects.csv",
            "dataset": "dataset.csv",
        },
        caption=(
            "In which direction does each parameter act? Each response over each "
            "free parameter: the mean of the surrogate over the other parameters. "
            "Points are the simulated samples. The goji berry's angle falls with "
            "the friction between berries: such piles pack more loosely, and the "
            "same berries need a wider foot (``repose docs uncertainty``, "
            "Sensitivity)."
        ),
        reads=("parameters", "targets"),
        folder="sensitivity",
        category="Uncertainty",
    ),
    "sequential": Drawn(
        "sequential.draw_sequential_batches",
        title="Probability and prediction by runs",
        inputs={"batches": "sequential/batches.csv", "check": "sequential/check.csv"},
        caption=(
            "How certain did the answer become, and after how many runs? Left the "
            "probability that the best parameter set meets all targets within the "
            "tolerance, after each batch of runs; dotted, the largest value that the "
            "remaining runs can reach; squares, the probability that any parameter set "
            "meets the targets. Beside it: the responses predicted at the best set, with "
            "one standard error, in percent off the target; the band is the "
            "tolerance. The filled point at the end is the answer simulated again "
            "with fresh seeds, with the standard error of its mean. It took no part "
            "in finding the answer."
        ),
        reads=("targets", "sequential.tolerance_percent", "sequential.probability"),
        folder="sequential",
        category="Sequential",
    ),
    "figure10": Drawn(
        "surrogate.draw_network_structure",
        title="Figure 10",
        inputs=NETWORK_INPUTS,
        caption=(
            "Figure 10. Which parameters does the trained network use? a: its "
            "structure, {inputs} parameters in, {network[hidden]} hidden neurons, "
            "{outputs} response(s) out. b: the influence of each parameter on what "
            "the network predicts, over the ranges of all parameters. The influence "
            "is the fraction of the variance of a response in which the parameter "
            "has a part (total Sobol index). Where parameters interact, the fractions "
            "add up to more than 100 %. With constraints, it is the fraction that "
            "remains if all other parameters are known, as in "
            "``sensitivity/sobol.csv``. An arrow shows whether the response rises or "
            "falls from the smallest to the largest value of the parameter."
        ),
        reads=("parameters", "design.seed"),
        when=has_network,
    ),
    "figure13": Drawn(
        "surrogate.draw_predicted_against_simulated",
        title="Figure 13",
        inputs={"predictions": "network/predictions.csv", "dataset": "dataset.csv"},
        optional=NETWORK_INPUTS,
        if_there={"fresh": "pool/fresh_dataset.csv"},
        caption=(
            "Figure 13. Does the surrogate predict samples that it has not seen? "
            "Predicted against simulated responses, on equal axes. Samples without "
            "a result are left out. A mean of few pours scatters about its true "
            "value, so no model can be nearer to the line than that scatter: the "
            "figure gives the R2 and the RMSE of a perfect model on the same "
            "samples beside those of the surrogate, for the test samples with the "
            "mean scatter of the whole design. By chance a model can seem better than "
            "the perfect one. The bars are ± 1 standard error of the simulated mean. "
            "The parts are predicted by the training part's fit, new points, where "
            "they were poured, by the final one."
        ),
        reads=("targets",),
    ),
    "figure05": Drawn(
        "testbench.draw_simulated_pile",
        title="Figure 5",
        inputs=PILE_INPUTS,
        caption=(
            "Figure 5. What does the simulated pile look like? Pile of the "
            "representative solution: the counterpart of the photographed pile."
        ),
        reads=("funnel", "colour"),
        when=has_pile,
        memory_mb=600,
    ),
    "figure06": Drawn(
        "testbench.draw_measurement_steps",
        title="Figure 6",
        inputs=MEASURED_PILE_INPUTS,
        caption=(
            "Figure 6. How is a pile measured? The steps on that pile in one side "
            "view: grey picture, threshold, edge, and boundary (yellow) with the "
            "Height (blue), the line of the left flank (red) and of the right one "
            "(green), each with its angle. The title names the line. The tables "
            "take the mean over {measure[views]} view(s)."
        ),
        reads=("measure",),
        when=has_pile,
    ),
    "figure08": Drawn(
        "testbench.draw_test_bench",
        title="Figure 8",
        inputs={},
        optional={"trajectory": POUR_TRAJECTORY, "particle": "berry/particle.json"},
        caption=(
            "Figure 8. How is a pile poured? The virtual test bench to scale, "
            "halfway through the pour: the place where grains are made, funnel and "
            "plate."
        ),
        reads=("funnel", "colour"),
        when=has_pile,
    ),
}
