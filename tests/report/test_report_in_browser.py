"""The report in headless Chromium: it loads, draws in 3-D, and what can be moved moves."""

import json
import re
import shutil
from contextlib import contextmanager

import numpy as np
import pandas as pd
import pytest
from made_up_report import ANSWER, made_up_study
from PIL import Image
from scipy.stats import norm
from shared import TARGETS
from test_report_page import MORE

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.surrogates import load, make
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.report.figures import style
from repose.report.page import page, prediction

pytestmark = [pytest.mark.slow, pytest.mark.essential]

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))),
    None,
)
if CHROMIUM is None:
    pytest.skip(
        "no Chromium on this machine (Debian: apt-get install chromium)",
        allow_module_level=True,
    )
playwright = pytest.importorskip(
    "playwright.sync_api", reason="playwright is not installed"
)
# 3-D without a graphics card; root has no sandbox.
OPTIONS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    config, jobs, files = made_up_study(folder, TARGETS, fixed=("e_gp",))
    page.write_report(
        config,
        jobs,
        files | pictures(folder),
        {"All samples": folder / "dataset.csv"},
        folder / "report.html",
    )
    return folder


def pictures(folder):
    """A photograph of 800 x 600 pixels, and two figures as wide as a page."""
    Image.new("RGB", (800, 600), "#777").save(folder / "photograph.jpg")
    with style.applied():
        for name in ("outline", "plane"):
            figure = style.new_figure(style.PAGE, 3.0)
            style.save(figure, folder / f"{name}.png", small_run=False)
    figures = {name: folder / f"{name}.png" for name in ("outline", "plane")}
    return {"photograph": folder / "photograph.jpg"} | figures


@pytest.fixture
def opened(browser, folder):
    with page_in(browser, folder, 800, 600, offline=True) as opened:
        yield opened


@contextmanager
def page_in(browser, folder, width=1280, height=720, **options):
    """A tab with the report of a folder; it complains of nothing."""
    with browser.new_context(
        viewport={"width": width, "height": height}, **options
    ) as context:
        # other programs may share the cores, and the picture is drawn without a card
        context.set_default_timeout(120_000)
        tab = context.new_page()
        complaints = []
        tab.on(
            "console",
            lambda message: (
                complaints.append(message.text) if message.type == "error" else None
            ),
        )
        tab.on("pageerror", lambda error: complaints.append(str(error)))
        tab.on(
            "request",
            lambda sent: (
                complaints.append(sent.url) if sent.url.startswith("http") else None
            ),
        )
        tab.goto((folder / "report.html").as_uri())
        yield tab
        assert complaints == []


def pixels(tab):
    """Colours of every seventh pixel of the 3-D view, (pixels, 4)."""
    coded = tab.evaluate(
        """() => { const gl = document.getElementById("pile").getContext("webgl2");
        const all = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
        gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, all);
        const few = []; for (let k = 0; k < all.length; k += 28) few.push(...all.subarray(k, k + 4));
        return few; }"""
    )
    return np.array(coded, dtype=int).reshape(-1, 4)


def reddish(colours):
    return int(((colours[:, 0] - colours[:, 2]) > 40).sum())


def move(tab, slider, value):
    code = "slider = document.getElementById(id); slider.value = value; slider.dispatchEvent(new Event('input'));"
    tab.evaluate(f"([id, value]) => {{ const {code} }}", [slider, value])


def check_predictions(found, model, X):
    """Compare what the page predicted at points (n, d) with the model; the page has single precision."""
    mean, std = model.predict(X, return_std=True, noise=False)
    np.testing.assert_allclose([row["mean"] for row in found], mean, rtol=1e-6)
    np.testing.assert_allclose([row["std"] for row in found], std, rtol=1e-4)


def test_javascript_predicts_what_python_predicts_with_one_network(opened, folder):
    # within and beyond the samples
    X = np.random.default_rng(2).uniform(0.02, 0.8, (40, len(PARAMETERS)))
    code = "X => X.map(networkPredictor(content.model))"
    found = opened.evaluate(code, X.tolist())
    check_predictions(found, load(folder / "network.json"), X)


def test_javascript_predicts_what_python_predicts_with_several_networks(opened):
    random = np.random.default_rng(3)
    X = random.uniform(size=(40, len(PARAMETERS)))
    means = np.column_stack([X[:, 0] + X[:, 1] ** 2, X[:, 2]])
    Y = means + random.normal(0, 0.1, (40, 2))
    settings = NetworkSettings.from_keys(
        {"hidden": 3, "starts": 4, "epochs": 100, "goal": 0.0}
    )
    model = make("network_ensemble", settings).fit(X, Y)
    assert len(model.members_) > 1
    space = contact_space({name: [0.0, 1.0] for name in PARAMETERS})
    content = prediction.describe_surrogate(model, space, X[0])
    code = "([model, X]) => X.map(networkPredictor(model))"
    found = opened.evaluate(code, [content, X[:10].tolist()])
    check_predictions(found, model, X[:10])


def test_the_pile_is_drawn_turns_and_falls(opened):
    resting = pixels(opened)
    assert reddish(resting) > 150
    opened.locator("#pile").scroll_into_view_if_needed()
    box = opened.locator("#pile").bounding_box()
    opened.mouse.move(box["x"] + 200, box["y"] + 150)
    opened.mouse.down()
    opened.mouse.move(box["x"] + 320, box["y"] + 200, steps=4)
    opened.mouse.up()
    turned = pixels(opened)
    assert (turned != resting).any(axis=1).mean() > 0.02
    assert opened.text_content("#clock") == "4.0 s"
    move(opened, "time", 2)
    falling = pixels(opened)
    assert opened.text_content("#clock") == "1.0 s"
    assert (falling != turned).any(axis=1).mean() > 0.02
    move(opened, "time", 8)
    assert reddish(pixels(opened)) > reddish(falling), (
        "half of the bodies were not there yet"
    )


def test_a_slider_moves_the_prediction_and_back(opened, folder):
    at_answer = opened.text_content("#predicted-aor_deg")
    assert opened.locator("#slide-e_gp").count() == 0, "it is fixed"
    move(opened, "slide-mus_gg", 0.75)
    moved = opened.text_content("#predicted-aor_deg")
    point = np.array([[(ANSWER | {"mus_gg": 0.75})[name] for name in PARAMETERS]])
    mean, std = load(folder / "network.json").predict(
        point, return_std=True, noise=False
    )
    numbers = [float(number) for number in re.findall(r"\d+\.?\d*", moved)]
    assert numbers == pytest.approx([mean[0, 0], std[0, 0]], rel=0.05)
    assert numbers[0] == pytest.approx(mean[0, 0], rel=1e-3)
    assert moved != at_answer
    opened.click("#home")
    assert opened.text_content("#predicted-aor_deg") == at_answer


def test_the_button_copies_the_parameters_and_a_table_sorts_both_ways(opened):
    opened.context.grant_permissions(["clipboard-read", "clipboard-write"])
    opened.click("#copy")
    opened.wait_for_function("document.getElementById('copy').textContent === 'Copied'")
    copied = opened.evaluate("navigator.clipboard.readText()")
    for name, value in ANSWER.items():
        assert f"{name}: {value:g}  #" in copied
    opened.click("summary")
    rows = "document.querySelectorAll('table.sorts tbody tr')"
    column = f"() => [...{rows}].map((row) => Number(row.cells[0].textContent))"
    before = opened.evaluate(column)
    for reverse in (False, True):
        opened.click("table.sorts th:first-child button")
        assert opened.evaluate(column) == sorted(before, reverse=reverse)


def test_a_phone_shows_all_without_scrolling_sideways(browser, folder):
    with page_in(browser, folder, 360, 740, is_mobile=True) as tab:
        assert tab.evaluate("document.documentElement.scrollWidth") == 360
        for place in (".pictures img", ".leading img"):
            figure = tab.locator(place).bounding_box()
            assert figure["x"] >= 0, place
            assert figure["x"] + figure["width"] <= 360, place
            assert figure["width"] > 300, place
        # Table 4 is a list of names and values, and the page ends at its edge.
        cells = tab.locator("table.sets tbody td:not(:empty)")
        boxes = [cell.bounding_box() for cell in cells.all()]
        assert all(box["x"] + box["width"] <= 360 for box in boxes)
        name = "getComputedStyle(cell, '::before').content"
        assert cells.last.evaluate(f"cell => {name}") == '"Height error (%)"'
        assert reddish(pixels(tab)) > 50
        values = tab.locator("table.answer td:nth-child(3)")
        assert all(
            values.nth(k).bounding_box()["x"] < 360 for k in range(len(PARAMETERS))
        )


def test_a_long_reason_makes_no_row_as_high_as_the_table(browser, tmp_path):
    config, jobs, files = made_up_study(tmp_path, TARGETS)
    table4 = pd.read_csv(files["table4"])
    table4["reason"] = "a grain moved by 4 mm, more than 1 mm; " * 6
    for number in range(12):
        table4[f"a_column_with_a_long_name_{number}"] = 1.0
    table4.to_csv(tmp_path / "wide.csv", index=False)
    tables = {"Sets simulated again": tmp_path / "wide.csv"}
    page.write_report(config, jobs, files, tables, tmp_path / "report.html")
    with page_in(browser, tmp_path, 1400, 900) as tab:
        tab.click("summary")
        row = tab.locator("table.sorts tbody tr").first.bounding_box()
        assert row["height"] < 360


def test_a_picture_is_seen_beside_the_verdict_without_scrolling(browser, folder):
    with page_in(browser, folder, 1400, 900) as tab:
        figure = tab.locator(".leading img").bounding_box()
        verdict = tab.locator(".verdict").first.bounding_box()
        table = tab.locator("table").first.bounding_box()
        assert verdict["y"] < figure["y"]
        assert figure["y"] + figure["height"] < min(900, table["y"])
        assert tab.locator(".pictures img").count() == 1, "it is shown once"


def test_print_is_one_page_with_the_answer_targets_table_4_and_the_pile(opened):
    opened.emulate_media(media="print")
    shown = (
        ".verdict",
        "#origin",
        "table.answer",
        "table.check",
        "table.sets",
        "#pile",
        ".pair img",
    )
    for part in (*shown, "#copy", "#play", "#sliders", "details", ".pictures"):
        assert opened.locator(part).first.is_visible() is (part in shown), part
    opened.emulate_media(media="null", color_scheme="dark")
    paper = opened.pdf(prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page\b", paper)) == 1
    assert re.search(rb"/MediaBox \[0 0 59[45][.\d]* 84[12]", paper), "A4"


def test_many_targets_and_sets_are_printed_on_one_page(browser, tmp_path):
    config, jobs, files = made_up_study(tmp_path, MORE)
    table4 = pd.read_csv(files["table4"])
    # the most that `validation` allows
    pd.concat([table4, table4[1:]]).to_csv(files["table4"], index=False)
    message = {
        "feasible": False,
        "message": 5 * "Nothing met in these ranges, and something else, too. ",
    }
    files["summary"].write_text(json.dumps(message))
    page.write_report(
        config, jobs, files | pictures(tmp_path), {}, tmp_path / "report.html"
    )
    with page_in(browser, tmp_path) as tab:
        paper = tab.pdf(prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page\b", paper)) == 1


def test_keys_turn_and_zoom_the_pile(opened):
    pile = opened.locator("#pile")
    assert "Arrow keys turn it" in pile.get_attribute("aria-label")
    opened.keyboard.press("Tab")
    while opened.evaluate("document.activeElement.id") != "pile":
        opened.keyboard.press("Tab")
    assert pile.evaluate("it => getComputedStyle(it).outlineStyle") == "solid", (
        "the focus is seen"
    )
    start = pixels(opened)
    for key in ("ArrowLeft", "ArrowUp"):
        before = pixels(opened)
        opened.keyboard.press(key)
        assert (pixels(opened) != before).any(axis=1).mean() > 0.01, key
    distant = reddish(pixels(opened))
    opened.keyboard.press("+")
    near = reddish(pixels(opened))
    opened.keyboard.press("-")
    assert (
        near > 1.1 * reddish(pixels(opened)) == pytest.approx(1.1 * distant, rel=0.02)
    )
    opened.keyboard.press("0")
    np.testing.assert_array_equal(pixels(opened), start)


def test_a_figure_opens_large_on_a_click_and_on_a_key(opened):
    button = opened.locator(".pictures button.enlarge")
    large = opened.locator("#large")
    assert button.get_attribute("aria-label").startswith(
        "Open large: Can the simulated piles meet the targets"
    )
    assert not large.is_visible()
    for open_it in (button.click, lambda: button.press("Enter")):
        open_it()
        assert large.locator("img").bounding_box()["width"] == pytest.approx(
            round(style.PAGE * style.DPI), abs=2
        )
        opened.keyboard.press("Escape")
        assert not large.is_visible()
        assert opened.evaluate("document.activeElement.className") == "enlarge", (
            "the focus is back"
        )


def test_dark_is_dark_and_figures_stay_on_white(opened):
    def lightness(place, of="backgroundColor"):
        colour = opened.locator(place).first.evaluate(
            "(it, of) => getComputedStyle(it)[of]", of
        )
        return sum(map(int, re.findall(r"\d+", colour)[:3])) / 3

    for scheme in ("light", "dark"):
        opened.emulate_media(color_scheme=scheme)
        assert abs(lightness("body", "color") - lightness("body")) > 150
        assert lightness(".gauge text", "fill") > 130 or scheme == "light"
        assert lightness(".pictures img") == 255
        for bright in (lightness("body"), pixels(opened)[-50:, :3].mean()):
            assert bright > 200 if scheme == "light" else bright < 60


def test_the_pile_is_beside_the_photograph_and_below_it_on_a_phone(browser, folder):
    for width, beside in ((1400, True), (800, True), (400, False)):
        with page_in(browser, folder, width, 740) as tab:
            pile = tab.locator("#pile").bounding_box()
            photograph = tab.locator(".pair img").bounding_box()
            assert (photograph["x"] >= pile["x"] + pile["width"]) is beside
            assert (photograph["y"] >= pile["y"] + pile["height"]) is not beside


def test_a_surrogate_of_curves_moves_two_parameters_together(browser, tmp_path):
    page.write_report(
        *made_up_study(tmp_path, TARGETS[:1], "quadratic"), {}, tmp_path / "report.html"
    )
    surrogate = load(tmp_path / "network.json")

    def check(tab, changes):
        point = [[(ANSWER | changes)[name] for name in PARAMETERS]]
        mean = surrogate.predict(np.array(point))
        shown = tab.text_content("#predicted-aor_deg").split()[0]
        assert float(shown) == pytest.approx(mean[0, 0], rel=1e-3)

    with page_in(browser, tmp_path) as tab:
        move(tab, "slide-mus_gg", 0.75)
        check(tab, {"mus_gg": 0.75})
        move(tab, "slide-e_gg", 0.37)
        check(tab, {"mus_gg": 0.75, "e_gg": 0.37})
        # A third slider puts the first one back.
        move(tab, "slide-mur_gp", 0.25)
        check(tab, {"e_gg": 0.37, "mur_gp": 0.25})
        first = float(tab.input_value("#slide-mus_gg"))
        assert first == pytest.approx(ANSWER["mus_gg"])
        tab.click("#home")
        check(tab, {})


@pytest.mark.parametrize("surrogate", ["network", "quadratic"])
def test_the_sliders_predict_nothing_that_a_constraint_forbids(
    browser, tmp_path, surrogate
):
    config, jobs, files = made_up_study(tmp_path, TARGETS[:1], surrogate)
    rule = "e_gp >= 0.5 * mus_gg"
    assert 0.5 * 0.75 > ANSWER["e_gp"] > 0.5 * ANSWER["mus_gg"]
    constrained = config | {"constraints": [rule]}
    page.write_report(constrained, jobs, files, {}, tmp_path / "report.html")
    with page_in(browser, tmp_path) as tab:
        at_answer = tab.text_content("#predicted-aor_deg")
        assert tab.locator("#forbidden").count() == 0
        move(tab, "slide-mus_gg", 0.75)
        words = tab.text_content("#predictions")
        assert words.startswith("No prediction")
        assert rule in words
        assert tab.locator("#predicted-aor_deg").count() == 0
        assert rule in tab.text_content("#other-parameters ~ p:nth-of-type(2)")
        # Another parameter makes the set allowed again.
        move(tab, "slide-e_gp", 0.45)
        assert tab.locator("#predicted-aor_deg").count() == 1
        tab.click("#home")
        assert tab.text_content("#predicted-aor_deg") == at_answer
    page.write_report(config, jobs, files, {}, tmp_path / "report.html")
    with page_in(browser, tmp_path) as tab:
        move(tab, "slide-mus_gg", 0.75)
        assert tab.locator("#predicted-aor_deg").count() == 1
        assert "constraint" not in tab.inner_text("body")


def test_a_phone_keeps_the_columns_on_what_is_open(browser, folder):
    with page_in(browser, folder, 390, 800, is_mobile=True) as tab:
        row = tab.locator("table.answer tbody tr").first
        for column in ("95 % interval", "left open", "searched"):
            cell = row.locator(f'td[data-head="{column}"]')
            assert cell.is_visible(), column
            box = cell.bounding_box()
            assert box["x"] + box["width"] <= 390, column


def test_the_sliders_show_the_probability_less_the_expected_optimism(browser, tmp_path):
    config, jobs, files = made_up_study(tmp_path, TARGETS[:1])
    table4 = pd.read_csv(files["table4"])
    table4["aor_optimism_deg"] = 0.4
    table4["aor_optimism_se_deg"] = 0.1
    table4.to_csv(files["table4"], index=False)
    page.write_report(config, jobs, files, {}, tmp_path / "report.html")
    point = np.array([[ANSWER[name] for name in PARAMETERS]])
    mean, std = load(tmp_path / "network.json").predict(
        point, return_std=True, noise=False
    )
    low, high = TARGETS[0]["range"]
    expected = norm(mean[0, 0] - 0.4, np.hypot(std[0, 0], 0.1))
    share = expected.cdf(high) - expected.cdf(low)
    with page_in(browser, tmp_path) as tab:
        text = tab.text_content("#predictions")
        shown = re.search(r"less the expected optimism: (?:more than )?(\d+) %", text)
        assert int(shown.group(1)) == pytest.approx(100 * share, abs=1)
        move(tab, "slide-mus_gg", 0.75)
        # The optimism is that of the answer, which the search chose.
        assert "less the expected optimism" not in tab.text_content("#predictions")


def scale_of(tab):
    """The bar of the 3-D view: its width in pixels, its length in mm."""
    length, unit = tab.text_content("#scale").split()
    assert unit == "mm"
    return tab.locator("#scale").bounding_box()["width"], float(length)


def test_the_bar_of_the_3d_view_has_its_stated_length(opened, tmp_path):
    """The plate is a disc of a known radius, seen from above at the bar's distance."""
    opened.locator("#pile").scroll_into_view_if_needed()
    opened.click("#look-above")
    opened.focus("#pile")
    radius_mm = opened.evaluate("content.pour.plate_mm")
    width = opened.locator("#pile").bounding_box()["width"]
    for _ in range(30):
        pixels_per_mm = np.divide(*scale_of(opened))
        if 2.2 * radius_mm * pixels_per_mm < width:
            break
        opened.keyboard.press("-")
    opened.locator("#pile").screenshot(path=tmp_path / "above.png")
    picture = np.array(Image.open(tmp_path / "above.png").convert("RGB"), dtype=int)
    background = picture[5, 5]
    is_other = (np.abs(picture - background) > 8).any(axis=2)
    # The border of the canvas and the bar are no part of the plate.
    rows = is_other[5:-45, 5:-5]
    seen = rows.sum(axis=1).max()
    assert seen == pytest.approx(2 * radius_mm * pixels_per_mm, rel=0.02)


def test_the_bar_grows_with_the_pile_and_its_length_is_round(opened):
    opened.focus("#pile")
    before, length = scale_of(opened)
    opened.keyboard.press("+")
    nearer, other_length = scale_of(opened)
    assert nearer / other_length == pytest.approx(1.15 * before / length, rel=0.01)
    for _ in range(12):
        opened.keyboard.press("-")
        pixels, length = scale_of(opened)
        assert f"{length:.0e}"[0] in "125"
        width = opened.locator("#pile").bounding_box()["width"]
        assert 0.09 * width < pixels < 0.26 * width
