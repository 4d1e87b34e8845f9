#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# boundary.sh NM LIST EXPORTS WANTED PROVIDER.a... -- USER.a...
#
# Writes the functions that static libraries PROVIDER define and static libraries USER call: as lines `FUNCTION symbol`
# to LIST, which functions.S includes; as a linker's version script, which exports them alone, to EXPORTS; as options,
# with which a linker takes them from static libraries, to WANTED. Fails when users need more than functions of
# providers: data, virtual tables and type information cannot be loaded late.
set -eu
nm=$1 list=$2 exports=$3 wanted=$4
shift 4
providers=
while [ "$1" != -- ]; do providers="$providers $1"; shift; done
shift

"$nm" --undefined-only "$@" | awk '$1 == "U" { print $2 }' | sort -u > "$list.needed"
# Weak definitions (inline functions, templates) stand in the users' own objects too.
"$nm" --defined-only $providers | awk '$2 ~ /^[TDBRSG]$/ { print $3, $2 }' | sort -u > "$list.provided"
join "$list.needed" "$list.provided" > "$list.symbols"
rm "$list.needed" "$list.provided"
if grep -v ' T$' "$list.symbols" >&2; then
    echo "boundary.sh: these symbols are no functions, so they cannot be loaded on demand" >&2
    exit 1
fi
if [ ! -s "$list.symbols" ]; then
    echo "boundary.sh: nothing is called across the boundary" >&2
    exit 1
fi
sed 's/^\([^ ]*\) .*/FUNCTION \1/' "$list.symbols" > "$list"
sed 's/^\([^ ]*\) .*/-Wl,--undefined=\1/' "$list.symbols" > "$wanted"
{
    echo '{ global:'
    sed 's/^\([^ ]*\) .*/    \1;/' "$list.symbols"
    echo '  local: *; };'
} > "$exports"
rm "$list.symbols"
