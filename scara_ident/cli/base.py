"""``scara-ident base``."""

from __future__ import annotations

from math import isnan

from scara_ident.cli import options
from scara_ident.cli.console import result_console, table


def base(robot: options.Robot = None, output: options.Output = None, json: options.Json = False) -> None:
    """Print the base parameters: what each is made of, what is not identifiable and why."""
    from scara_ident.files import check_output, write_json
    from scara_ident.report.base import base_dict
    from scara_ident.robot.robot import load_robot

    check_output(output)
    arm = load_robot(robot)
    content = base_dict(arm)
    console = result_console(content, json)
    bodies = table("bodies", "number", "joint", "link", "reduction", right=("reduction",))
    for body in content["bodies"]:
        bodies.add_row(str(body["number"]), body["joint"], body["link"], f"{body['reduction']:g}")
    console.print(bodies)
    rows = table(f"{arm.name}: {content['count']} base parameters", "name", "URDF", "unit", "made of", right=("URDF",))
    for row in content["base_parameters"]:
        value = "" if isnan(row["urdf"]) else f"{row['urdf']:.4g}"
        rows.add_row(row["name"], value, row["unit"], row["expression"])
    console.print(rows)
    console.print(f"never appear in the torque: {', '.join(content['never_enter']) or 'none'}")
    console.print(f"appear only in sums: {', '.join(content['only_in_sums']) or 'none'}")
    for row in content["approximate"]:
        console.print(
            f"note: {row['name']} is grouped with others though {row['share']:.1e} of its column is independent; an "
            f"angle in the URDF may have too few digits"
        )
    check = content["check"]
    console.print(f"check: rank {check['rank']} of {content['count']}, torque unchanged to {check['torque_error']:.1e}")
    if check["rank"] < content["count"]:
        console.print(
            f"note: {content['count'] - check['rank']} of the base parameters are almost sums of others, and no motion "
            f"distinguishes them; angles with few digits in the URDF cause this: write 1.5707963267948966 for 1.57"
        )
    if output is not None:
        write_json(output / "base.json", content)
        console.written(output, "base.json")
