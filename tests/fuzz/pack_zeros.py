# SPDX-License-Identifier: Apache-2.0
"""Packs runs of zeros of a file as the target `vdb` unpacks them (vdb.cpp), for a new input of it.

    python3 pack_zeros.py FILE.vdb INPUT
"""
import re
import sys
from pathlib import Path


def packed(zeros):
    left, result = len(zeros), b""
    while left > 0:
        count = min(left // 256, 128)
        code = 127 + count if count > 0 else min(left, 128) - 1
        result += bytes([0, code])
        left -= count * 256 if count > 0 else code + 1
    return result


if __name__ == "__main__":
    source, target = map(Path, sys.argv[1:])
    target.write_bytes(re.sub(rb"\0+", lambda run: packed(run.group()), source.read_bytes()))
