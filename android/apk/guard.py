#!/usr/bin/python3
"""usage: guard.py FILE.apk        (Debian's androguard)
The APK as androguard reads it: manifest, permissions, signatures, and native methods in the dex that the library in the APK exports."""
import logging
import sys

from androguard.core.bytecodes.apk import APK
from androguard.core.bytecodes.dvm import DalvikVMFormat

logging.disable(logging.WARNING)
apk = APK(sys.argv[1])
bad = []
if not apk.is_valid_APK() or not apk.is_signed_v2() or not apk.is_signed_v3():
    bad.append("not valid, or not signed with v2 and v3")
if apk.get_permissions() != ["android.permission.RECORD_AUDIO"]:
    bad.append(f"permissions: {apk.get_permissions()}")
if set(apk.get_activities()) != {"org.visavis.demo.DemoActivity", "org.visavis.demo.MeasureActivity"} or apk.get_main_activity() != "org.visavis.demo.DemoActivity":
    bad.append(f"activities: {apk.get_activities()}")
dex = DalvikVMFormat(apk.get_dex())
names = {c.get_name() for c in dex.get_classes()}
if missing := [a for a in apk.get_activities() if f"L{a.replace('.', '/')};" not in names]:
    bad.append(f"activities without a class: {missing}")
library = apk.get_file("lib/arm64-v8a/libvisavis_jni.so")
natives = [m for m in dex.get_methods() if m.get_access_flags() & 0x100]
for method in natives:
    symbol = f"Java_{method.get_class_name()[1:-1].replace('/', '_')}_{method.get_name()}"
    if symbol.encode() + b"\0" not in library:
        bad.append(f"the library exports no {symbol}")
if not natives:
    bad.append("no native methods")
print(f"androguard: {apk.get_package()} {apk.get_androidversion_name()}, {len(names)} classes, {len(natives)} native methods, icon {apk.get_app_icon()}")
for text in bad:
    print("BAD:", text)
sys.exit(bool(bad))
