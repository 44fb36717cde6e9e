import runpy
import xml.etree.ElementTree as ElementTree

from setuptools import find_packages, setup

NAME = "haptic_teleop_omni"
MANIFEST = ElementTree.parse("package.xml").getroot()
MAINTAINER = MANIFEST.find("maintainer")

# Read by path: importing the package would need its dependencies, which a build machine may not have.
EXECUTABLES = runpy.run_path(f"{NAME}/executables.py")["EXECUTABLES"]

setup(
    name=NAME,
    version=MANIFEST.findtext("version"),
    description=MANIFEST.findtext("description"),
    maintainer=MAINTAINER.text,
    maintainer_email=MAINTAINER.get("email"),
    license=MANIFEST.findtext("license"),
    packages=find_packages(),
    package_data={
        "": ["*"],
        NAME: ["*", "layouts/*", "udev/*"],
    },  # pages, pictures and tables that lie among the modules
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    entry_points={"console_scripts": [f"{name} = {target}" for name, (target, _) in EXECUTABLES.items()]},
)
