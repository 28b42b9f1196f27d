"""``scara-ident base``."""

from __future__ import annotations

from scara_ident.cli.console import JsonOption, OutputOption, RobotOption, output_console, print_json, table


def base(robot: RobotOption = None, output: OutputOption = None, json: JsonOption = False) -> None:
    """Print the base parameters: what each is made of, what is not identifiable and why."""
    from scara_ident.files import check_output, write_json
    from scara_ident.report.base import base_dict
    from scara_ident.robot.robot import load_robot

    check_output(output)
    arm = load_robot(robot)
    content = base_dict(arm)
    if json:
        print_json(content)
    console = output_console(quiet=json)
    bodies = table("bodies", "number", "joint", "link", "reduction", right=("reduction",))
    for body in content["bodies"]:
        bodies.add_row(str(body["number"]), body["joint"], body["link"], f"{body['reduction']:g}")
    console.print(bodies)
    rows = table(f"{arm.name}: {content['count']} base parameters", "name", "unit", "made of")
    for row in content["base_parameters"]:
        rows.add_row(row["name"], row["unit"], row["expression"])
    console.print(rows)
    console.print(f"never enter the torque: {', '.join(content['never_enter']) or 'none'}", markup=False)
    console.print(f"enter only in sums: {', '.join(content['only_in_sums']) or 'none'}", markup=False)
    for row in content["approximate"]:
        console.print(
            f"note: {row['name']} is regrouped though {row['share']:.1e} of its column is independent; "
            "an angle in the URDF may have few digits",
            markup=False,
        )
    check = content["check"]
    console.print(
        f"check: rank {check['rank']} of {content['count']}, torque unchanged to {check['torque_error']:.1e}",
        markup=False,
    )
    if output is not None:
        write_json(output / "base.json", content)
        console.print(f"written: {output / 'base.json'}", markup=False, soft_wrap=True)
