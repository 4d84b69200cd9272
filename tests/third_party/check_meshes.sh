#!/bin/sh
# check_meshes.sh MAKE_MESHES ISOBRICK FOLDER INTERPRETER SCRIPT
# Writes meshes into FOLDER and has SCRIPT check them. Exit status 77: skipped,
# because the interpreter or the library that reads the meshes is missing.
set -u
make_meshes=$1 isobrick=$2 folder=$3 interpreter=$4 script=$5
if ! command -v "$interpreter" >/dev/null 2>&1; then
  echo "skipped: no $interpreter"
  exit 77
fi
rm -rf "$folder"
mkdir -p "$folder"
"$make_meshes" "$folder" || exit 1
# A surface with every case of the tables, in the program's own words.
"$isobrick" synth gyroid "$folder/gyroid.zarr" --dims 260,240,230 --type u8 --levels 1 --quiet || exit 1
for name in gyroid.ply gyroid.obj gyroid.vtp gyroid.pvtp gyroid.glb gyroid.quantized.glb; do
  case $name in *quantized*) set -- --quantize ;; *) set -- ;; esac
  "$isobrick" extract "$folder/gyroid.zarr" --isovalue 100.5 --normals gradient "$@" --quiet \
    -o "$folder/$name" || exit 1
done
# Its parts are compressed where the program can.
for name in gyroid.compressed.glb gyroid.quantized.compressed.glb; do
  case $name in *quantized*) set -- --quantize ;; *) set -- ;; esac
  "$isobrick" extract "$folder/gyroid.zarr" --isovalue 100.5 --normals gradient "$@" --quiet \
    --compress -o "$folder/$name" || [ $? -eq 2 ] || exit 1
done
# Colours of vertices.
for name in gyroid.coloured.glb gyroid.coloured.compressed.glb; do
  case $name in *compressed*) set -- --compress ;; *) set -- ;; esac
  "$isobrick" extract "$folder/gyroid.zarr" --isovalue 100.5 --roi :60,:50,:40 "$@" --quiet \
    --attribute "v=$folder/gyroid.zarr" --colour-by v=90:110 -o "$folder/$name" || [ $? -eq 2 ] ||
    exit 1
done
# A sample equals the isovalue: triangles without area.
for name in flat.ply flat.obj flat.vtp flat.pvtp flat.glb; do
  "$isobrick" extract "$folder/gyroid.zarr" --isovalue 100 --roi :60,:50,:40 --quiet \
    -o "$folder/$name" || exit 1
done
"$interpreter" "$script" "$folder"
status=$?
[ $status -ne 0 ] || rm -rf "$folder"
exit $status
