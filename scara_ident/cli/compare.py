"""``scara-ident compare``."""

from __future__ import annotations

from scara_ident.cli import options
from scara_ident.cli.console import READING_SHARE, check_report, progress, result_console, show_recordings, writing


def compare(
    recordings: options.Recordings,
    robot: options.Robot = None,
    model: options.Model = "complete",
    method: options.Method = "wls",
    output: options.Output = None,
    json: options.Json = False,
    verbose: options.Verbose = False,
) -> None:
    """Fit the parameters to each trajectory, and predict every trajectory with them."""
    from scara_ident.cli.reading import read_beside
    from scara_ident.robot.robot import load_robot

    check_report(output, "comparison")
    arm = load_robot(robot)
    with progress() as work:
        work("reading the recordings")
        with read_beside(arm, recordings) as wanted:
            from scara_ident.files import write_json
            from scara_ident.identification.compare import compare as run
            from scara_ident.report.comparison import comparison_dict
            from scara_ident.report.summaries.comparison import tables

            ((given, useless),) = wanted()
        result = run(arm, given, model=model, method=method, progress=work.part(READING_SHARE, 1.0))
    content = comparison_dict(result)
    console = result_console(content, json)
    if verbose:
        show_recordings(console, given)
    console.note([*useless, *result.notes])
    for each in tables(content):
        console.print(each)
    console.say(content["summary"])
    if output is not None:
        from scara_ident.report.html.comparison import comparison_report

        with writing(output) as (place, _):
            comparison_report(place / "report.html", content)
            write_json(place / "comparison.json", content)
        console.written(output, "comparison.json", "report.html")
