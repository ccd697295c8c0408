"""Types into zsh and fish, each on a terminal of its own, and prints the command lines that Tab has completed.

    complete.py SHELL FOLDER KEYS..    the folder of the installed completions; \\t in KEYS is Tab

A function of the program's name prints what it is called with, so that the line counts as the shell understands it.
"""

import os
import pty
import re
import select
import sys
import time

SECONDS = 60  # for each line, on a busy machine

ZSH = r"""
PS1=
fpath=({folder} $fpath)
autoload -U compinit
compinit -D -u
isomesh isomeshd() {{ print -r -- "called: $0 $*;" }}
print are""you ready
"""
FISH = r"""
set -p fish_complete_path {folder}
function isomesh; echo "called: isomesh $argv;"; end
function isomeshd; echo "called: isomeshd $argv;"; end
echo are""you ready
"""
SHELLS = {"zsh": (["zsh", "-f", "-i"], ZSH), "fish": (["fish", "--no-config", "--interactive"], FISH)}


class Terminal:
    def __init__(self, command):
        self.seen = ""
        self.process, self.keys = pty.fork()
        if self.process == 0:
            os.execvpe(command[0], command, {**os.environ, "TERM": "xterm", "HOME": "/nonexistent"})

    def type(self, text):
        os.write(self.keys, text.encode())

    def wait_for(self, pattern):
        until = time.monotonic() + SECONDS
        while not (found := re.search(pattern, self.seen, re.DOTALL)):
            ready, _, _ = select.select([self.keys], [], [], max(0, until - time.monotonic()))
            if not ready:
                sys.exit(f"nothing like {pattern} within {SECONDS} s: {self.seen!r}")
            self.seen += os.read(self.keys, 65536).decode(errors="replace")
        self.seen = self.seen[found.end() :]
        return found


def main(shell, folder, *lines):
    command, setting = SHELLS[shell]
    terminal = Terminal(command)
    terminal.type(setting.format(folder=folder))
    terminal.wait_for("areyou ready")
    for line in lines:
        terminal.type(line.replace("\\t", "\t") + "\n")
        print(terminal.wait_for(r"called: ([^;\r\n]*);")[1].strip())
    terminal.type("exit\n")
    os.waitpid(terminal.process, 0)


main(*sys.argv[1:])
