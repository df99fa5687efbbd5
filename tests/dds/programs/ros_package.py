"""Adds a package of services to a ROS 2 from PyPI, run by its Python: generated, compiled and put beside rclpy.

    build/peers/jazzy/bin/python tests/dds/programs/ros_package.py tests/dds/programs/packages/example_interfaces

ROS 2 from PyPI has no `example_interfaces`, but it has the generators of its code, the headers and the libraries that
this code needs. What a workspace would build as eight libraries becomes one extension module here: the type support
of rmw_fastrtps alone, bound at once, so that nothing is looked for at run time. Services (`srv/*.idl`) whose fields
are of basic types only.

Needs a compiler of C++ (``CXX``, else g++) and the headers of this Python. Ends with code 3 and one line when they
are not there, with another one when something went wrong.
"""

import logging
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Final

NOT_HERE: Final = 3
"""The code of the end when a tool is missing."""

LIBRARIES: Final = """
    service_msgs__rosidl_generator_py service_msgs__rosidl_generator_c service_msgs__rosidl_typesupport_c
    service_msgs__rosidl_typesupport_fastrtps_c rosidl_typesupport_fastrtps_c rosidl_typesupport_fastrtps_cpp
    rosidl_typesupport_c rosidl_runtime_c rcutils rmw fastcdr
""".split()

LEFT_BEHIND: Final = ["*.c", "*.cpp", "*.h", "*.json", "detail", "msg"]
"""Files that were made on the way."""


def main(source: Path) -> None:
    """Make the package of the folder `source` importable in this environment."""
    compiler = shutil.which(os.environ.get("CXX", "g++"))
    headers = Path(sysconfig.get_path("include")) / "Python.h"
    if compiler is None or not headers.exists():
        print("there is no compiler of C++" if compiler is None else f"there is no {headers}")
        sys.exit(NOT_HERE)
    home = Path(sysconfig.get_path("platlib")) / source.name
    with tempfile.TemporaryDirectory(prefix="ros-package-") as room:
        built = Path(room) / source.name
        generate(source, built)
        build(compiler, built)
        shutil.rmtree(home, ignore_errors=True)
        shutil.copytree(built, home, ignore=shutil.ignore_patterns(*LEFT_BEHIND))
    # In a process of its own, as this one has not loaded what the module needs.
    module = f"{source.name}.{source.name}_s__rosidl_typesupport_c"
    subprocess.run([sys.executable, "-c", f"import {module}"], check=True)


def generate(source: Path, built: Path) -> None:
    """Write C, C++ and Python for the services of `source` to `built`."""
    os.environ["AMENT_PREFIX_PATH"] = sys.prefix  # where the generators look for their templates
    logging.disable(logging.WARNING)  # each plug-in is found twice, as lib64 is a link to lib

    from rosidl_generator_c.cli import GenerateC
    from rosidl_generator_py.cli import GeneratePython
    from rosidl_typesupport_c.cli import GenerateCTypesupport
    from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport

    files = [f"{source}:srv/{each.name}" for each in sorted(source.glob("srv/*.idl"))]
    known = [f"{sys.prefix}/share"]
    for generator in (
        GenerateC("c"),
        GeneratePython("py", typesupport_implementations=["rosidl_typesupport_c"]),
        GenerateCTypesupport("c", typesupport_implementations=["rosidl_typesupport_fastrtps_c"]),
        GenerateFastRTPSCTypesupport("fastrtps_c"),
    ):
        generator.generate(source.name, files, known, built)
    (built / "__init__.py").touch()


def build(compiler: str, built: Path) -> None:
    """Compile everything below `built` to the one module that the generated Python imports."""
    import numpy as np

    include = Path(sys.prefix) / "include"
    folders = [
        built.parent,
        include,
        *(each.parent for each in include.glob("*/*") if each.name == each.parent.name),
    ]
    folders += [Path(sysconfig.get_path("include")), Path(np.get_include())]
    flags = ["-O1", "-fPIC", *(f"-I{each}" for each in folders)]
    objects = []
    for number, file in enumerate(sorted([*built.rglob("*.c"), *built.rglob("*.cpp")])):
        objects.append(f"{built}/{number}.o")
        language = ["-x", "c", "-std=gnu11"] if file.suffix == ".c" else ["-std=c++17"]
        subprocess.run([compiler, *language, *flags, "-c", str(file), "-o", objects[-1]], check=True)
    module = built / f"{built.name}_s__rosidl_typesupport_c.so"
    places = [f"-L{sys.prefix}/lib", "-Wl,-rpath,$ORIGIN/../../.."]
    wanted = [f"-l{each}" for each in LIBRARIES]
    subprocess.run([compiler, "-shared", *objects, *places, *wanted, "-o", str(module)], check=True)
    for each in objects:
        Path(each).unlink()


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]).resolve())
    except subprocess.CalledProcessError as error:  # its own words stand above
        sys.exit(f"{error.cmd[0]} ended with code {error.returncode}")
