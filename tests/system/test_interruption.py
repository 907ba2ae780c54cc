"""The end of a command that a signal interrupts."""

import subprocess
import sys

WAITS_FOR_EVER = """
import sys
sys.argv, sys.orig_argv = ["-m"], ["python", "-m", "warp_torchrl"]
import atexit, os, signal, threading
import warp_torchrl
from warp_torchrl.system.signals import exit_on_signal

class Interrupted:
    def __del__(self):
        threading.Event().wait()

kept = Interrupted()
atexit.register(print, "exit functions ran", flush=True)
with exit_on_signal():
    {then}
"""


def end_of(program):
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=30)
    return done.returncode, done.stdout.splitlines(), done.stderr


def test_destructors_of_what_a_signal_interrupted_are_left_out():
    program = WAITS_FOR_EVER.format(then="os.kill(os.getpid(), signal.SIGTERM)")
    assert end_of(program) == (143, ["exit functions ran"], "error: stopped by signal SIGTERM\n")


def test_a_command_that_ends_by_itself_ends_as_any_program():
    program = WAITS_FOR_EVER.format(then="pass").replace("threading.Event().wait()", "print('destroyed', flush=True)")
    assert end_of(program) == (0, ["exit functions ran", "destroyed"], "")
