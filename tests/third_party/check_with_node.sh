#!/bin/sh
# check_with_node.sh SCRIPT ARGUMENTS …
# Runs it with Node.js. Exit status 77: skipped, because there is none.
command -v node >/dev/null 2>&1 || { echo "skipped: no node"; exit 77; }
exec node "$@"
