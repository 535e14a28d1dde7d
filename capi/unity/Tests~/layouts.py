#!/usr/bin/env python3
"""Prints a C program that prints sizes and offsets of visavis.h's structs, a line each, under the names that C# gives them: layouts.py HEADER"""
import re
import sys

text = re.sub(r"//[^\n]*|/\*.*?\*/", "", open(sys.argv[1], encoding="utf-8").read(), flags=re.S)
camel = lambda name: "".join(word[:1].upper() + word[1:] for word in name.split("_"))
print('#include "visavis.h"\n#include <stdio.h>\nint main(void) {')
for name, body in re.findall(r"typedef struct visavis_(\w+) \{(.*?)\}", text, re.S):
    print(f'    printf("{camel(name)} %zu\\n", sizeof(visavis_{name}));')
    for field, count in re.findall(r"(\w+)(?:\[(\d+)\])?;", body):
        # An array is a field each, called by its axes: hips[3] is HipsX, HipsY, HipsZ.
        for i in range(int(count or 1)):
            of, end = (f"{field}[{i}]", "XYZW"[i]) if count else (field, "")
            print(f'    printf("{camel(name)}.{camel(field)}{end} %zu\\n", offsetof(visavis_{name}, {of}));')
print("    return 0;\n}")
