"""Unpack MuJoCo's library and licences from a wheel, after its hash has been checked.

Arguments: the wheel, its sha256, the folder to write, the library's path in the wheel, its version.
Exit status 3: the hash differs (the hash that was found is printed).
"""

import hashlib
import io
import os
import shutil
import sys
import zipfile

wheel, sha256, folder, library, version = sys.argv[1:]

# Read once: what is unpacked is what was hashed.
with open(wheel, "rb") as file:
    content = file.read()
found = hashlib.sha256(content).hexdigest()
if found != sha256:
    print(found)
    sys.exit(3)

licences = f"mujoco-{version}.dist-info/licenses/"
with zipfile.ZipFile(io.BytesIO(content)) as archive:
    for name in archive.namelist():
        if name == library:
            target = os.path.join(folder, "lib", os.path.basename(name))
        elif name.startswith(licences) and not name.endswith("/"):
            target = os.path.join(folder, "licenses", os.path.basename(name))
        else:
            continue
        os.makedirs(os.path.dirname(target), exist_ok=True)
        with archive.open(name) as source, open(target, "wb") as file:
            shutil.copyfileobj(source, file)
            file.flush()
            os.fsync(file.fileno())

# The linker looks for the short name; programs load the long one, which is the library's SONAME.
os.symlink(os.path.basename(library), os.path.join(folder, "lib", "libmujoco.so"))
