"""What each column of a recording is, in a sentence: those of every kind of measurement, and those that effects go by.

Columns of one kind alone stand with the kind.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

COLUMNS: Mapping[str, str] = MappingProxyType({
    "measurement": "Number of the set-up: points of one measurement belong together.",
    "point": "Number of the point in its measurement.",
    "repeat": "1, 2, …: the same place measured again; 1 where the column is left out.",
    "x_mm": "Indicated coordinate x; one number in all rows for an axis that nobody reads.",
    "y_mm": "Indicated coordinate y, likewise.",
    "z_mm": "Indicated coordinate z, likewise.",
    "reference_mm": "Certified distance of this point from point 1 of its measurement.",
    "reference_u_um": "Standard uncertainty of that distance by the certificate; of a plate, of each coordinate of the ball.",
    "reference_U_um": "The same as expanded uncertainty, with `[artefact] k` or `degrees_of_freedom`.",
    "reference_u_x_um": "Standard uncertainty of `reference_x_mm`, where the coordinates of a ball have different ones.",
    "reference_u_y_um": "Standard uncertainty of `reference_y_mm`, likewise.",
    "reference_u_z_um": "Standard uncertainty of `reference_z_mm`, likewise.",
    "reference_x_mm": "Certified, or nominal, x of this ball or hole in the plate's own frame.",
    "reference_y_mm": "Certified, or nominal, y of this ball or hole in the plate's own frame.",
    "reference_z_mm": "Certified, or nominal, z of this ball or hole in the plate's own frame.",
    "approach_x": "Direction of travel along x into the point: −1, 0 or +1.",
    "approach_y": "Direction of travel along y into the point: −1, 0 or +1.",
    "approach_z": "Direction of travel along z into the point: −1, 0 or +1.",
    "nx": "Outward unit normal at the probed point, along x.",
    "ny": "Outward unit normal at the probed point, along y.",
    "nz": "Outward unit normal at the probed point, along z.",
    "time_s": "Time since the start of the job, or by a clock that began more than 12 days before.",
    "temp_x_c": "Temperature of the scale of x.",
    "temp_y_c": "Temperature of the scale of y.",
    "temp_z_c": "Temperature of the scale of z.",
    "temp_artefact_c": "Temperature of the artefact, by which its length is corrected with cte_per_k.",
    "temp_table_top_c": "Temperature of the table's top.",
    "temp_table_bottom_c": "Temperature of the table's underside.",
    "temp_bridge_top_c": "Temperature of the top of the bridge.",
    "temp_bridge_bottom_c": "Temperature of the underside of the bridge.",
    "temp_ram_front_c": "Temperature of the front of the ram.",
    "temp_ram_back_c": "Temperature of the back of the ram.",
    "temp_air_c": "Temperature of the air.",
    "pressure_hpa": "Pressure of the air.",
    "humidity_pct": "Relative humidity of the air.",
    "speed_mm_s": "Scanning speed.",
    "gamma_deg": "Turn of the digitizer about its own axis.",
    "depth_mm": "Scan depth of the point, along the digitizer's line of sight.",
    "turned_deg": "By how much a sphere was turned about Z against its first set-up: what turns with it is its own form.",
    "tip_x_mm": "Offset of the stylus tip from the end of the ram, along x.",
    "tip_y_mm": "Offset of the stylus tip from the end of the ram, along y.",
    "tip_z_mm": "Offset of the stylus tip from the end of the ram, along z.",
    "radius_mm": "Radius of the fit that gave the point.",
    "fit_rms_um": "Root mean square of the residuals of the fit that gave the point.",
    "n_points": "Number of points of the fit that gave the point.",
})  # fmt: skip
