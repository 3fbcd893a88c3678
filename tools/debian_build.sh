#!/bin/sh
# Builds the packages in the folders beside this script, in the clean chroot that
# tools/debian_packages.py makes, and imports one that needs others of ours and none of ROS 2.
set -u
cd "$(dirname "$0")" || exit 1
for folder in */debian; do
    one=${folder%/debian}
    if (cd "$one" && DEB_BUILD_OPTIONS=nocheck dpkg-buildpackage -us -uc -b -Pnocheck) \
        >"$one.log" 2>&1; then
        echo "built $one"
    else
        echo "FAILED $one"
        tail -n 5 "$one.log"
    fi
done
# With all that they need of Debian, and nothing else.
apt-get install -y -qq ./ros-jazzy-slosh-base_*.deb ./ros-jazzy-slosh-model_*.deb >/dev/null
PYTHONPATH=$(echo /opt/ros/jazzy/lib/python3*/site-packages)
export PYTHONPATH
python3 -c "
import slosh_model
text = 'container: {shape: cylinder, radius: 0.05, fill_height: 0.07}'
print('installed', slosh_model.__file__, slosh_model.parse_model(text))"
