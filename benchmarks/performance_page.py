"""The tables of docs/performance.md: the parts of a step, what the machine allows, and scale with threads.

    python benchmarks/performance_page.py                 # 500 and 5,000 berries, a minute of a core
    python benchmarks/performance_page.py --large         # also 50,000 berries, and 500,000 in 400 steps of fall
    python benchmarks/performance_page.py --estimate      # what a run would take; measures nothing

Run it on idle cores. It writes each table where the page has the line `<!-- benchmarks/performance_page.py: NAME -->`, up
to the line `<!-- end -->`, with the processor and the commit. `--page` names another file.
"""

import argparse
import re
import time
from pathlib import Path

import scale
import step_shares

from repose.common import provenance

PAGE = Path(__file__).parents[1] / "docs" / "performance.md"
BLOCK = re.compile(
    r"(<!-- benchmarks/performance_page\.py: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL
)
SHARES_OF = 500  # berries of the bed whose step is taken apart
BERRIES = (500, 5000)
LARGE = (50_000,)
FALLING, FALL_STEPS = 500_000, 400
# For the estimate, from earlier runs on an AMD EPYC of Zen 5: one berry and step, at rest and in fall; one berry to
# place; the compilation.
REST_S, FALL_S, PLACE_S, COMPILE_S = 8e-8, 1.6e-7, 6e-5, 60.0


def estimate_s(berries, threads, falling, settle_steps, fall_steps):
    """Time of a core that the measurements take [s]."""
    timed_steps = scale.REPEATS * scale.TIMED_STEPS * len(threads)
    total = COMPILE_S
    for count in berries:
        total += count * (settle_steps * FALL_S + timed_steps * REST_S + PLACE_S)
    for _ in threads:
        total += falling * (fall_steps * FALL_S + PLACE_S)
    return total


def table(header, rows):
    """A table of Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "".join(f"| {' | '.join(map(str, cells))} |\n" for cells in lines)


def shares_table(simulation, berries, rounds):
    """The parts of a step of a settled bed, and the share of each."""
    step_us = step_shares.step_us(simulation, rounds)
    contacts = len(simulation.contacts())
    parts = step_shares.parts_us(simulation, step_us, rounds)
    rows = [
        [name, f"{us:.1f}", f"{100 * us / step_us:.0f} %"] for name, us in parts.items()
    ]
    rows.append(["**step**", f"{step_us:.1f}", f"{berries:,} berries, {contacts:,} contacts"])  # fmt: skip
    contact_us = parts["pairs: all of it"]
    return table(["part of a step", "µs", "share"], rows), contact_us


def bound_table(contact_ns, rounds):
    """What the arithmetic of a contact takes, and what the engine takes."""
    bound_ns = step_shares.bound_ns(rounds)
    operations = (
        f"{2 * step_shares.FUSED} operations, {step_shares.ROOTS} roots, "
        f"{step_shares.DIVISIONS} divisions"
    )
    rows = [
        [f"arithmetic alone: {operations}", f"{bound_ns:.1f}", "1.00"],
        ["the engine", f"{contact_ns:.1f}", f"{contact_ns / bound_ns:.2f}"],
    ]
    return table(["a contact of two berries", "ns", "ratio"], rows)


def scale_table(rows):
    """Settled beds by their number of berries and threads."""
    first = rows[0].contact_ns
    cells = [
        [
            f"{row.berries:,}",
            row.threads,
            f"{2 * row.contacts / row.berries:.2f}",
            f"{row.step_us:.4g}",
            f"{row.contact_ns:.1f}",
            f"{row.contact_ns / first:.2f}",
            f"{row.memory_mb:.0f}",
        ]
        for row in rows
    ]
    header = [
        "berries",
        "threads",
        "contacts per berry",
        "µs per step",
        "ns per contact and step",
        f"ratio to {rows[0].berries:,}",
        "peak MB",
    ]
    return table(header, cells)


def fall_row(count, threads, steps):
    """Time the first steps of so many berries that fall from a loose lattice."""
    simulation = scale.settled_bed(count, threads, settle_steps=0)
    simulation.threads = threads
    simulation.run_steps(1)  # compiles, and makes the first lists
    began = time.perf_counter()
    simulation.run_steps(steps)
    seconds = time.perf_counter() - began
    step_ms = 1e3 * seconds / steps
    return [f"{count:,}", threads, steps, f"{seconds:.1f}", f"{step_ms:.3g}"]


def written(page, blocks):
    """The text of a page with these blocks in place of its own, by name.

    A block that is not given stays; a name without a place is an error.
    """
    places = {name for _, name, _ in BLOCK.findall(page)}
    missing = sorted(set(blocks) - places)
    if missing:
        raise SystemExit(f"the page has no place for {', '.join(missing)}")

    def replaced(match):
        begin, name, end = match.groups()
        if name not in blocks:
            return match[0]
        return f"{begin}\n{blocks[name]}\n{end}"

    return BLOCK.sub(replaced, page)


def main(words=None):
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--berries", type=int, nargs="+", default=list(BERRIES))
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--shares-of", type=int, default=SHARES_OF)
    parser.add_argument("--settle-steps", type=int, default=scale.SETTLE_STEPS)
    parser.add_argument("--rounds", type=int, default=step_shares.ROUNDS)
    parser.add_argument("--large", action="store_true")
    parser.add_argument("--falling", type=int, default=0)
    parser.add_argument("--fall-steps", type=int, default=FALL_STEPS)
    parser.add_argument("--page", type=Path, default=PAGE)
    parser.add_argument("--estimate", action="store_true")
    arguments = parser.parse_args(words)
    berries, falling = arguments.berries, arguments.falling
    if arguments.large:
        berries, falling = [*berries, *LARGE], FALLING
    seconds = estimate_s(
        [arguments.shares_of, *berries],
        arguments.threads,
        falling=falling,
        settle_steps=arguments.settle_steps,
        fall_steps=arguments.fall_steps,
    )
    print(f"about {seconds / 60:.1f} minutes of a core", flush=True)
    if arguments.estimate:
        return

    bed = scale.settled_bed(arguments.shares_of, settle_steps=arguments.settle_steps)
    blocks = {}
    blocks["shares"], pairs_us = shares_table(
        bed, arguments.shares_of, arguments.rounds
    )
    contact_ns = 1e3 * pairs_us / max(int(bed.counts[step_shares.st.N_PAIRS]), 1)
    blocks["bound"] = bound_table(contact_ns, arguments.rounds)
    rows = []
    for count in berries:
        bed = scale.settled_bed(
            count, arguments.threads[0], settle_steps=arguments.settle_steps
        )
        rows += [scale.row_of(bed, count, threads) for threads in arguments.threads]
    blocks["scale"] = scale_table(rows)
    if falling:
        header = ["berries in fall", "threads", "steps", "s", "ms per step"]
        falls = [
            fall_row(falling, threads, arguments.fall_steps)
            for threads in arguments.threads
        ]
        blocks["fall"] = table(header, falls)
    machine = provenance.describe_machine()
    origin = table(
        ["measured on", "commit"], [[machine["processor"], str(machine["commit"])[:8]]]
    )
    blocks = {name: f"{text}\n{origin}" for name, text in blocks.items()}
    text = written(arguments.page.read_text(encoding="utf-8"), blocks)
    arguments.page.write_text(text, encoding="utf-8")
    print(f"wrote {', '.join(blocks)} in {arguments.page}")


if __name__ == "__main__":
    main()
