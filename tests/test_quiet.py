"""Nothing of other languages' readers reaches the error stream, and all else does again afterwards."""

from __future__ import annotations

import os
from threading import Barrier, Thread

from scara_ident.quiet import quiet_stderr


def test_nothing_is_written_inside_and_all_after(capfd):
    with quiet_stderr():
        os.write(2, b"a panic\n")
        with quiet_stderr():
            os.write(2, b"within\n")
        os.write(2, b"another\n")
    os.write(2, b"our line\n")
    assert capfd.readouterr().err == "our line\n"


def test_threads_that_overlap_leave_the_stream_as_it_was(capfd):
    both, one_left = Barrier(2), Barrier(2)

    def first() -> None:
        with quiet_stderr():
            both.wait()
        one_left.wait()

    def second() -> None:
        with quiet_stderr():
            both.wait()
            one_left.wait()
            os.write(2, b"still quiet\n")

    threads = [Thread(target=first), Thread(target=second)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    os.write(2, b"our line\n")
    assert capfd.readouterr().err == "our line\n"
