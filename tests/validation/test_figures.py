"""Every figure that is drawn from the committed results: no two texts overlap.

`charts.save` looks at the boxes of the texts as they are drawn, and raises.
"""

from pathlib import Path

import pytest
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

import validation
from validation.applications import large_figures
from validation.derivatives import packages_figure
from validation.harness import charts
from validation.paper import figures as paper_figures
from validation.paper import stability_figures
from validation.peers import front_figure, profiles, work_precision_figure
from validation.repeated import figures as repeated
from validation.repeated import front_figure as repeated_front
from validation.stress import comparison_figure

RESULTS = Path(validation.__file__).parent / "results"
FIGURES = {
    "derivatives": lambda to: packages_figure.plot(
        RESULTS / "derivatives-peers.csv", to / "a.png"
    ),
    "front": lambda to: front_figure.plot(RESULTS / "work-precision.csv", to / "a.png"),
    "front, repeated": lambda to: repeated_front.draw(RESULTS, to / "a.png"),
    "latency": lambda to: repeated.draw_latency(RESULTS / "latency.csv", to / "a.png"),
    "sequences": lambda to: repeated.draw_sequences(
        RESULTS / "sequences.csv", to / "a.png"
    ),
    "work-precision": lambda to: work_precision_figure.plot(
        RESULTS / "work-precision.csv", to / "a.png"
    ),
    "profiles": lambda to: profiles.plot(RESULTS / "profiles.csv", to / "a.png"),
    "stress": lambda to: comparison_figure.plot(RESULTS / "stress.csv", to / "a.png"),
    "large": lambda to: large_figures.plot(RESULTS / "large.csv", to),
    "paper": lambda to: paper_figures.plot(RESULTS, to),
    "stability": lambda to: stability_figures.plot(RESULTS, to),
}


@pytest.mark.parametrize("name", FIGURES)
def test_no_texts_overlap(name, tmp_path, monkeypatch):
    def write(figure, file, **_):
        file.write_bytes(b"drawn")

    monkeypatch.setattr(Figure, "savefig", write)
    FIGURES[name](tmp_path)
    assert list(tmp_path.iterdir())


def test_overlapping_texts_are_found(tmp_path):
    figure, axes = plt.subplots()
    axes.text(0.5, 0.5, "one")
    axes.text(0.52, 0.5, "two")
    hidden = axes.text(0.5, 0.5, "hidden")
    hidden.set_visible(False)
    assert charts.overlapping_texts(figure) == [("one", "two")]
    with pytest.raises(ValueError, match="overlapping"):
        charts.save(figure, tmp_path / "a.png")
    plt.close(figure)


def test_names_stand_beside_their_lines():
    figure, axes = plt.subplots()
    lines = {"low": [(0.1, 0.1), (0.9, 0.1)], "high": [(0.1, 0.9), (0.9, 0.9)]}
    for points in lines.values():
        axes.plot(*zip(*points, strict=True))
    charts.name_lines(axes, {name: (points, "k") for name, points in lines.items()})
    names = {text.get_text(): text.xy[1] for text in axes.texts}
    assert names == {"low": 0.1, "high": 0.9}
    assert charts.overlapping_texts(figure) == []
    plt.close(figure)
