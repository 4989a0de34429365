"""Run a command and append its time and memory to a file: python measured.py FILE COMMAND..."""

import json
import os
import resource
import subprocess
import sys
import time

begin = time.monotonic()
status = subprocess.run(sys.argv[2:], check=False).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
words = sys.argv[2:]
output = words[words.index("-o") + 1] if "-o" in words else ""
scale = 1 if sys.platform == "darwin" else 1024  # unit of ru_maxrss [bytes]
measured = {
    "output": output,
    "processor": used.ru_utime + used.ru_stime,
    "wall": time.monotonic() - begin,
    "memory": used.ru_maxrss * scale / 1e6,
}
file = os.open(sys.argv[1], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
os.write(file, (json.dumps(measured) + "\n").encode())
sys.exit(status)
