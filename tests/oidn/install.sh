#!/bin/sh
# install.sh FOLDER: puts Open Image Denoise's library into FOLDER/pyoidn/oidn/lib, from the Python package that carries
# it, where it is not there yet. Exits with 77 where that cannot be had: tests that need it are skipped.
folder=$1
package=pyoidn==2.5.1.0
[ -e "$folder/$package" ] && exit 0
skip() {
  echo "skipped: tests with Open Image Denoise, because $*"
  exit 77
}
command -v python3 >/dev/null || skip "there is no python3 to install $package with"
rm -rf "$folder" "$folder.new"
output=$(python3 -m pip install --quiet --no-deps --only-binary :all: --retries 1 --timeout 30 --target "$folder.new" "$package" 2>&1) ||
  skip "pip cannot install $package: $(echo "$output" | grep -i error | tail -1)"
touch "$folder.new/$package"
mv "$folder.new" "$folder"
