"""The tables of ``calibration.json``: which keys there are, and what each may hold."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from sheetoflight.model.target import CollinearTarget, MarkerKind


class _Part(BaseModel):
    """Keys that are not known are left to whoever wrote them."""

    model_config = ConfigDict(extra="ignore", strict=True, allow_inf_nan=False, frozen=True)


_Three = Annotated[list[float], Field(min_length=3, max_length=3)]
_Two = Annotated[list[float], Field(min_length=2, max_length=2)]
_Five = Annotated[list[float], Field(min_length=5, max_length=5)]
_Name = Annotated[str, Field(min_length=1)]


class CameraPart(_Part):
    """``camera``: image size, K row by row, and Brown's coefficients."""

    image_size: Annotated[
        list[Annotated[int, Field(ge=1, le=1_000_000)]], Field(min_length=2, max_length=2)
    ]
    matrix: Annotated[list[_Three], Field(min_length=3, max_length=3)] | None = None
    distortion: _Five | None = None


class SheetMapPart(_Part):
    """An entry of ``sheet_maps``: metric homography from the image to the sheet."""

    name: _Name
    parameters: _Five


class CurvaturePart(_Part):
    """``light_planes[].curvature``: how a sheet bends away from its plane."""

    centre: _Three
    axes: Annotated[list[_Two], Field(min_length=3, max_length=3)]
    per_mm: _Three


class LightPlanePart(_Part):
    """An entry of ``light_planes``: ``n · X = d``, and what a curved sheet has beside it."""

    name: _Name
    normal: _Three
    distance_mm: float
    curvature: CurvaturePart | None = None


class TargetPart(_Part):
    """``target``: what gave the scale."""

    kind: Literal["collinear"]
    markers_mm: list[float]
    tolerance_mm: float
    marker: MarkerKind
    marker_size_mm: float
    expansion_per_K: float = CollinearTarget.expansion_per_K
    warmer_by_K: float = CollinearTarget.warmer_by_K
    warmer_by_std_K: float = CollinearTarget.warmer_by_std_K
    expansion_std_per_K: float = CollinearTarget.expansion_std_per_K


class SourcePart(_Part):
    """An entry of ``covariance.sources``: one cause's share, in the order of ``parameters``."""

    name: _Name
    component: _Name | None = None
    matrix: list[list[float]]


class NoisePart(_Part):
    """``covariance.noise``: what was estimated of the noise, an entry for each component."""

    components: list[_Name]
    std: list[Annotated[float, Field(ge=0)]]
    relative_covariance: list[list[float]]


class CovariancePart(_Part):
    """``covariance``: a row and a column for each of ``parameters``."""

    parameters: list[_Name]
    matrix: list[list[float]]
    sources: list[SourcePart] = []
    noise: NoisePart = NoisePart(components=[], std=[], relative_covariance=[])


class ViewPart(_Part):
    """An entry of ``residuals.views``: a row for each marker, then in stage crossing for each
    laser's spot, null where it was not seen."""

    stage: str = ""
    view: str = ""
    uv: list[_Two | None] = []
    residuals: list[_Two | None] = []
    xyz: list[_Three | None] = []


class ResidualsPart(_Part):
    """``residuals``: how the observations fit."""

    rms_px: Annotated[float, Field(ge=0)]
    chi2_per_dof: Annotated[float, Field(ge=0)]
    views: list[ViewPart] = []


class FindingPart(_Part):
    """An entry of ``findings``: one cause that the residuals point to."""

    stage: _Name
    cause: _Name
    text: _Name
    remedy: _Name
    explained: Annotated[float, Field(ge=0, le=1)]
    odds: Annotated[float, Field(ge=0, le=1)]
    shift: Annotated[float, Field(ge=0)] = 0.0


class PropagatedPart(_Part):
    """An entry of ``monte_carlo.parameters``: one quantity, by Monte Carlo and as stated."""

    name: _Name
    value: float
    mean_shift: float
    std: Annotated[float, Field(ge=0)]
    low: float
    high: float
    analytic_std: Annotated[float, Field(gt=0)]
    analytic_low: float
    analytic_high: float
    coverage: Annotated[float, Field(ge=0, le=1)]
    std_ratio_std: Annotated[float, Field(ge=0)]
    width_ratio_std: Annotated[float, Field(ge=0)]
    coverage_std: Annotated[float, Field(ge=0)]


class PropagatedLengthPart(PropagatedPart):
    """An entry of ``monte_carlo.lengths``: between two image points ``uv``."""

    laser: _Name
    uv: Annotated[list[_Two], Field(min_length=2, max_length=2)]


class MonteCarloPart(_Part):
    """``monte_carlo``: the rig re-simulated and calibrated again, many times."""

    trials: Annotated[int, Field(ge=1)]
    refused: Annotated[int, Field(ge=0)]
    first_refusal: str = ""
    seed: Annotated[int, Field(ge=0)]
    parameters: list[PropagatedPart]
    lengths: list[PropagatedLengthPart]


class OpinionPart(_Part):
    """``second_opinion.rod`` and ``.board``: what each determines alone."""

    views: Annotated[int, Field(ge=1)]
    determines: list[_Name]
    refusal: str = ""


class AgreementPart(_Part):
    """An entry of ``second_opinion.parameters``: by the rod, and by the board."""

    name: _Name
    first: float
    second: float
    std: Annotated[float, Field(ge=0)]


class SheetAgreementPart(_Part):
    """An entry of ``second_opinion.sheets``: points of the same pixels by either."""

    laser: _Name
    points: Annotated[int, Field(ge=1)]
    nearest_mm: float
    farthest_mm: float
    rms_mm: Annotated[float, Field(ge=0)]
    largest_mm: Annotated[float, Field(ge=0)]
    std_mm: Annotated[float, Field(ge=0)]


class ScaleDifferencePart(_Part):
    """``second_opinion.scale``: how far all lengths by the board are longer."""

    relative: Annotated[float, Field(gt=-1)]
    std: Annotated[float, Field(ge=0)]
    odds: Annotated[float, Field(ge=0, le=1)]
    rest_odds: Annotated[float, Field(ge=0, le=1)]


class SecondOpinionPart(_Part):
    """``second_opinion``: rod and board, each solved alone; ``noise_freedom`` is null where all
    noise was stated."""

    rod: OpinionPart
    board: OpinionPart
    parameters: list[AgreementPart]
    chi2: Annotated[float, Field(ge=0)]
    degrees_of_freedom: Annotated[int, Field(ge=0)]
    noise_freedom: Annotated[float, Field(gt=0)] | None = None
    odds: Annotated[float, Field(ge=0, le=1)]
    sheets: list[SheetAgreementPart]
    scale: ScaleDifferencePart | None = None


class CalibrationDocument(_Part):
    """The whole file, its ``format`` and ``version`` checked before.

    ``light_planes`` is empty where the camera alone was calibrated. What this package writes
    beyond the documented keys may be missing: ``target`` (then its tolerance is not in the
    uncertainty), ``pixel_std`` (then ``rms_px``), ``warnings``, ``findings``, ``monte_carlo`` and
    ``second_opinion`` (then none was made), and of ``covariance`` its ``sources`` and ``noise``
    (then what it comes from is not known).
    """

    method: _Name
    camera: CameraPart
    light_planes: list[LightPlanePart] | None = None
    sheet_maps: list[SheetMapPart] = []
    target: TargetPart | None = None
    pixel_std: Annotated[float, Field(ge=0)] | None = None
    covariance: CovariancePart
    residuals: ResidualsPart
    findings: list[FindingPart] = []
    warnings: list[str] = []
    provenance: dict[str, Any] = {}
    monte_carlo: MonteCarloPart | None = None
    second_opinion: SecondOpinionPart | None = None
