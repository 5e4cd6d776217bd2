"""How every figure looks and is written."""
import os

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

BLUE, ORANGE, GREEN, RED, GREY, LIGHT = "#1f6fb4", "#e07b1a", "#2a9d57", "#c2383a", "#6b7280", "#d1d5db"
SERIES = (BLUE, GREEN, "#8b5cf6", RED)
STYLE = {
    "font.size": 10, "axes.titlesize": 11, "axes.labelsize": 10, "axes.spines.top": False, "axes.spines.right": False,
    "axes.grid": True, "axes.axisbelow": True, "grid.color": "#e5e7eb", "grid.linewidth": 0.8, "axes.edgecolor": "#9ca3af",
    "xtick.color": "#374151", "ytick.color": "#374151", "axes.labelcolor": "#111827", "legend.frameon": False,
    "lines.linewidth": 1.6, "figure.dpi": 130, "svg.fonttype": "path", "pdf.fonttype": 42,
}
FORMATS = ("png", "pdf", "svg")
MOST_POINTS = 1500  # of a line: more than a printed column resolves


def subplots(*shape, **options):
    return plt.subplots(*shape, constrained_layout=True, **options)


def thin(*columns):
    """Columns with at most MOST_POINTS rows, the last one kept."""
    step = max(1, -(-len(columns[0]) // MOST_POINTS))
    keep = np.r_[0:len(columns[0]):step, len(columns[0]) - 1]
    return [column[keep] for column in columns]


def write(figure, folder, name, formats=FORMATS):
    """Writes the figure in each format and closes it; the paths."""
    paths = [os.path.join(folder, f"{name}.{extension}") for extension in formats]
    with plt.rc_context(STYLE):
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # laid out once, not once per format
        for path in paths:
            figure.savefig(path, **({"pil_kwargs": {"compress_level": 3}} if path.endswith(".png") else {}))
    plt.close(figure)
    return paths
