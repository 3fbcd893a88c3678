"""What of the nodes' diagnostics is told to whoever watches a cell."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from slosh_bringup.cell_watch import ERROR, OK, SILENT, STALE, WARN, CellWatch, NodeReport, reports


def told(*said, nodes=("camera",)):
    """The lines for reports (level, sentence) of the camera, one a second."""
    watch = CellWatch(nodes, 0.0)
    lines = []
    for second, (level, sentence) in enumerate(said, start=1):
        lines += watch.take(NodeReport("camera", level, sentence, {}), float(second))
    return lines


def test_a_change_is_told_once_it_lasts_and_once_it_is_over():
    silent = [(STALE, f"no image for {second} s: nobody publishes it") for second in range(1, 6)]
    assert told(*silent, (OK, "measuring"), (OK, "measuring")) == [
        "camera: no image for 2 s: nobody publishes it",
        "camera: OK again: measuring",
    ]


def test_what_comes_and_goes_is_not_told():
    assert told((WARN, "dark"), (OK, "fine"), (WARN, "dark"), (ERROR, "bad"), (OK, "fine")) == []


def test_another_cause_is_told_and_other_numbers_are_not():
    assert told((WARN, "3 lost"), (WARN, "5 lost"), (WARN, "7 late"), (WARN, "0.5 late")) == [
        "camera: 5 lost",
        "camera: 0.5 late",
    ]


def test_a_node_that_says_nothing_is_named_once():
    watch = CellWatch(["camera", "monitor"], 0.0)
    assert watch.take(NodeReport("monitor", OK, "fine", {}), 3.0) == []
    assert watch.look(SILENT - 0.1) == []
    assert watch.look(SILENT + 0.1) == ["camera: no diagnostics for 5 s"]
    assert watch.look(SILENT + 0.2) == []
    assert watch.take(NodeReport("camera", OK, "fine", {}), 7.0) == []
    assert watch.look(3.0 + SILENT + 0.1) == ["monitor: no diagnostics for 5 s"]


def test_reports_are_those_of_the_cells_own_namespace():
    def status(name):
        pairs = [KeyValue(key="state", value="ready")]
        return DiagnosticStatus(level=STALE.to_bytes(1), name=name, message="m", values=pairs)

    names = ("/slosh/camera", "/slosh/deep/camera", "/camera", "/other/camera", "arm: motor")
    message = DiagnosticArray(status=[status(name) for name in names])
    assert list(reports(message, "/slosh")) == [
        NodeReport("camera", STALE, "m", {"state": "ready"})
    ]
    assert [report.node for report in reports(message, "/")] == ["camera"]
