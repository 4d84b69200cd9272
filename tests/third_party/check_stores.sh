#!/bin/sh
# check_stores.sh MAKE_STORES FOLDER INTERPRETER SCRIPT
# Writes stores into FOLDER and has SCRIPT check each. Exit status 77: skipped,
# because the interpreter or the library that reads the stores is missing.
set -u
make_stores=$1 folder=$2 interpreter=$3 script=$4
if ! command -v "$interpreter" >/dev/null 2>&1; then
  echo "skipped: no $interpreter"
  exit 77
fi
rm -rf "$folder"
mkdir -p "$folder"
"$make_stores" "$folder" >"$folder/list" || exit 1
checked=0
while read -r store arrays; do
  # The arguments are ARRAY=RAW without spaces, one store a line.
  # shellcheck disable=SC2086
  "$interpreter" "$script" "$store" $arrays
  status=$?
  [ $status -eq 0 ] || exit $status
  checked=$((checked + 1))
done <"$folder/list"
[ $checked -gt 0 ] || { echo "no store was checked"; exit 1; }
rm -rf "$folder"
