"""The command line's entry: which commands there are, and how an error is told."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from cyclopts import App, CycloptsError, Parameter

from sheetoflight import __version__
from sheetoflight.errors import SheetOfLightError

_INTERRUPTED = 130
_BAD_USAGE = 2
_BROKEN_PIPE = 141

COMMANDS = {
    "demo": """The main job on the paper's rig, rendered: pictures to lengths, and a report.

Renders the pictures, detects the target, calibrates by every method, measures the lengths of the
paper's Tables 2 and 4, and writes report.html.

Example: sol demo demo/""",
    "target": """Draw a target to print, true to scale.

Print it at 100 %, glue it to something stiff and straight, and measure the marker distances.

Example: sol target target.pdf --markers-mm 0 100 200 --page a4""",
    "plan": """What uncertainty of lengths to expect, before any picture is taken.

Reads rig.toml with a table [plan]: focal length, angle and distance of the sheet. Tells the
uncertainty over the field and over numbers of positions, how many reach a wanted one, and which
position helps most next.

Example: sol plan rig.toml --wanted-mm 0.1 --page plan.html

Example: sol plan rig.toml --calibration calibration.json""",
    "simulate": """Render a rig folder with pictures, and the truth beside it.

Example: sol simulate rig/ --seed 1 --distortion -0.1 0.05 0 0 0""",
    "detect": """Find the target in a rig folder's pictures and write points.csv.

Example: sol detect rig/""",
    "calibrate": """Calibrate camera and sheet of light from a rig folder.

Reads rig.toml, and points.csv or else the pictures in camera/ and plane/.

Example: sol calibrate rig/ -o calibration.json""",
    "convert": """Camera and light planes from and to the files of other tools.

OpenCV, ROS, Kalibr, HALCON and Bouguet's toolbox are read and written. What the other file cannot
hold, and how far a fitted lens model is off, is told.

Example: sol convert calibration.json camera.yaml --to ros

Example: sol convert campar.dat calibration.json --pose lightplane.dat --pixel-std 0.1

Example: sol convert calib_data.mat rig/points.csv""",
    "measure": """Lengths with their 95 % intervals, from segments.csv or from pictures.

Between the image points of a segments.csv, or between the ends of each piece of the laser line in
pictures.

Example: sol measure calibration.json segments.csv -o lengths.csv

Example: sol measure calibration.json rig/measure -o lengths.csv""",
    "verify": """Known lengths against measured ones: errors, limits, and what stands out.

Measures as sol measure does and compares with the lengths given by --known, or in a column
known_mm of segments.csv. Exit status 4 where a length fails.

Example: sol verify calibration.json rig/measure --known 300 --mpe-mm 0.2

Example: sol verify calibration.json segments.csv --known known.csv --page verification.html""",
    "stripe": """The laser line's centres in pictures, each with its standard uncertainty.

Finds lines of any direction by itself, in pictures, folders, stacks and videos, and writes
image,u,v,std_px,width_px,peak.

Example: sol stripe scan/*.png -o stripe.csv

Example: sol stripe profiles.npy --scan columns --detector centroid -o stripe.csv""",
    "reconstruct": """The laser line in space: a point cloud with the uncertainty of every point.

Example: sol reconstruct calibration.json rig/measure -o cloud.ply""",
    "compare": """All methods of calibration side by side on one simulated rig.

Equal numbers of pictures, equal noise: errors of the sheet and of lengths, their share of the
Cramér–Rao bound, whether the intervals hold, time. The trials run on all cores, or on a dask
cluster.

Example: sol compare -o comparison.csv --report comparison.html

Example: sol compare --case paper --scheduler tcp://127.0.0.1:8786""",
    "report": """One self-contained page: the numbers, figures to turn, what was used.

Example: sol report calibration.json rig/measure -o report.html""",
}
"""Every command and what its help says; the module of the same name is loaded when it is called."""

app = App(
    name="sol",
    version=__version__,
    help="Calibrate a camera and a sheet of light, and measure with known uncertainty.\n\n"
    "Example, from photographs of a target to a length and a report:\n\n"
    "  sol calibrate rig/ -o calibration.json\n\n"
    "  sol measure calibration.json rig/measure -o lengths.csv\n\n"
    "  sol report calibration.json rig/measure -o report.html",
    help_format="plaintext",
    result_action="return_value",
    suppress_keyboard_interrupt=False,
    default_parameter=Parameter(negative_iterable=()),
)
for _name, _help in COMMANDS.items():
    _paragraphs = (" ".join(paragraph.split()) for paragraph in _help.split("\n\n"))
    app.command(f"sheetoflight.cli.{_name}:{_name}", name=_name, help="\n\n".join(_paragraphs))


def main(words: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    try:
        app(words, exit_on_error=False, print_error=False)
        sys.stdout.flush()
    except CycloptsError as error:
        return _told(
            f"{_one_line(str(error)).rstrip('.')} – see sol --help, or sol COMMAND --help",
            _BAD_USAGE,
        )
    except SheetOfLightError as error:
        return _told(_one_line(str(error)), error.exit_status)
    except KeyboardInterrupt:
        return _told("interrupted – nothing half-written was left", _INTERRUPTED)
    except BrokenPipeError:
        return _left_alone()
    except SystemExit as end:
        # rich ends the program by itself, and as a failure, when nobody reads its tables
        if not isinstance(end.__context__, BrokenPipeError):
            raise
        return _left_alone()
    except OSError as error:
        sys.stdout = None
        return _told(
            f"the result cannot be written ({error.strerror}) – make room, or write elsewhere",
            _BAD_USAGE,
        )
    return 0


def run() -> None:
    """Entry point of the installed commands."""
    sys.exit(main())


def _left_alone() -> int:
    """Whoever read our output has gone: keep the interpreter from complaining while closing."""
    sys.stdout = None
    return _BROKEN_PIPE


def _told(message: str, status: int) -> int:
    print(f"error: {message}", file=sys.stderr)
    return status


def _one_line(message: str) -> str:
    return " ".join(message.split())


if __name__ == "__main__":
    run()
