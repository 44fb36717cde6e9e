import runpy
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from setuptools import find_packages, setup

NAME = "haptic_teleop_control"
MANIFEST = ElementTree.parse("package.xml").getroot()
MAINTAINER = MANIFEST.find("maintainer")

# Read by path: importing the package would need its dependencies, which a build machine may not have.
EXECUTABLES = runpy.run_path(f"{NAME}/executables.py")["EXECUTABLES"]

# The settings of every situation lie at the top of the repository, where people look for them; they are
# installed into this package's share folder because a launch looks there.
CONFIG = Path("..", "..", "config")
SHARE = Path("share", NAME, "config")
CONFIG_FILES = [
    (str(SHARE / folder.relative_to(CONFIG)), sorted(str(file) for file in folder.glob("*.yaml")))
    for folder in sorted({file.parent for file in CONFIG.rglob("*.yaml")})
]

setup(
    name=NAME,
    version=MANIFEST.findtext("version"),
    description=MANIFEST.findtext("description"),
    maintainer=MAINTAINER.text,
    maintainer_email=MAINTAINER.get("email"),
    license=MANIFEST.findtext("license"),
    packages=find_packages(),
    package_data={"": ["*"]},  # pages, pictures and tables that lie among the modules
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", sorted(str(file) for file in Path("launch").glob("*.launch.py"))),
        *CONFIG_FILES,
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    entry_points={"console_scripts": [f"{name} = {target}" for name, (target, _) in EXECUTABLES.items()]},
)
