"""The tables that say how light, radio, wheels and calibrations behave, the same for all robots."""

from typing import Annotated

from msgspec import Meta

from fleet.simulation.scenario.fields import Chance, Length, Rate, Sigma, Table


class Led(Table, frozen=True, kw_only=True):
    """levels_per_s: grey levels, summed over the spot, per second of exposure, at 1 m on its axis;
    at an angle a from it by cos(a) ** exponent less."""

    levels_per_s: Rate = 9e6
    exponent: Annotated[float, Meta(ge=0.0, le=50.0)] = 1.0


class Optics(Table, frozen=True, kw_only=True):
    """gain: grey levels per electron; halo: share of the light that is spread four times as wide;
    ambient in grey levels; skew_s: by how much the right camera is triggered later."""

    exposure_s: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.002
    sigma_px: Annotated[float, Meta(ge=0.3, le=5.0)] = 1.2
    read_noise: Annotated[float, Meta(gt=0.0, le=50.0)] = 1.5
    gain: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.025
    ambient: Annotated[float, Meta(ge=0.0, le=250.0)] = 20.0
    halo: Annotated[float, Meta(ge=0.0, le=0.5)] = 0.02
    skew_s: Annotated[float, Meta(ge=-0.1, le=0.1)] = 20e-6


class Laser(Table, frozen=True, kw_only=True):
    """A Gaussian beam of radius beam_m (1/e^2) that grows by divergence_rad, and the photodiodes:
    a disc of radius photodiode_m that needs least_w_m2, within acceptance_deg of its normal."""

    power_w: Rate = 1e-3
    beam_m: Length = 0.002
    divergence_rad: Annotated[float, Meta(ge=0.0, le=0.1)] = 0.0008
    photodiode_m: Length = 0.012
    acceptance_deg: Annotated[float, Meta(gt=0.0, le=90.0)] = 65.0
    least_w_m2: Rate = 1.0


class Air(Table, frozen=True, kw_only=True):
    """Chances are of each reply and of each round."""

    missed: Chance = 0.05
    phantom: Chance = 0.01
    reader_range_m: Length = 85.0
    write_range_m: Length = 30.0


class Odometry(Table, frozen=True, kw_only=True):
    """scale, turn_scale, drift_rad_per_m: sigmas of what is wrong all the time; noise_m, noise_rad:
    sigmas after 1 m, turn_noise_rad after 1 rad; slips: per m, each by one sigma of slip_*."""

    scale: Sigma = 0.005
    turn_scale: Sigma = 0.005
    drift_rad_per_m: Sigma = 0.001
    noise_m: Sigma = 0.004
    noise_rad: Sigma = 0.004
    turn_noise_rad: Sigma = 0.004
    slips_per_m: Sigma = 0.01
    slip_m: Sigma = 0.01
    slip_rad: Sigma = 0.01


class Calibration(Table, frozen=True, kw_only=True):
    """Sigmas of what each robot's files have wrong; exact: nothing, not even of the scanner."""

    exact: bool = False
    baseline_share: Sigma = 0.0005
    disparity_px: Sigma = 0.2
    principal_px: Sigma = 0.2
    camera_m: Sigma = 0.002
    camera_rad: Sigma = 0.001
