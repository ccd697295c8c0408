#!/usr/bin/env bash
# Makes an STL of a volume with curl alone, step by step. So you can leave a job and come back to it.
#
#   examples/curl/mesh.sh head.nii.gz 60 head.stl
#
# ISOMESH_SERVER names the daemon. ISOMESH_TOKEN is the token, if the daemon requires one.
set -euo pipefail

if [[ $# -ne 3 ]]; then
  echo "Usage: mesh.sh VOLUME ISO OUT.stl" >&2
  exit 2
fi
file="$1"
iso="$2"
output="$3"
server="${ISOMESH_SERVER:-http://127.0.0.1:8080}"

# The token and the volume are for the daemon only, so a proxy of the environment gets neither: --noproxy.

# ask ARGUMENT..: prints the body of the response. An error ends the script with the server's reason.
ask() {
  local token=() answer status
  [[ -z "${ISOMESH_TOKEN:-}" ]] || token=(--header "Authorization: Bearer $ISOMESH_TOKEN")
  answer="$(curl --silent --show-error --noproxy '*' --write-out '\n%{http_code}' "${token[@]}" "$@")"
  status="${answer##*$'\n'}"
  answer="${answer%$'\n'*}"
  if [[ "$status" != 2* ]]; then
    echo "mesh.sh: $(member detail "$answer")" >&2
    return 1
  fi
  printf '%s' "$answer"
}

# member NAME JSON: prints the first text with that name, without characters that control a terminal.
# jq does this better, if it is installed.
member() {
  sed -n "s/.*\"$1\":\"\([^\"]*\)\".*/\1/p" <<<"${2//,\"/$'\n'\"}" | head -n 1 | tr -d '\000-\037\177'
}

answer="$(ask --request POST --upload-file "$file" "$server/v1/volumes")"
volume="$(member id "$answer")"
answer="$(ask "$server/v1/jobs" --header 'Content-Type: application/json' \
  --header "Idempotency-Key: $volume-$iso" \
  --data "{\"volume\": \"$volume\", \"iso\": $iso, \"formats\": [\"stl\"]}")"
job="$(member id "$answer")"
state=queued
while [[ "$state" == queued || "$state" == running ]]; do
  answer="$(ask "$server/v1/jobs/$job?wait=30")"
  state="$(member state "$answer")"
done
if [[ "$state" != succeeded ]]; then
  echo "mesh.sh: job $job: $state: $(member detail "$answer")" >&2
  exit 1
fi
if [[ "$answer" == *'"empty":true'* ]]; then
  echo "mesh.sh: job $job: the surface is empty: $(member empty_reason "$answer")" >&2
  exit 1
fi
# An earlier mesh stays until the new one is here as a whole.
part="$output.part"
trap 'rm -f -- "$part"' EXIT
status="$(curl --silent --show-error --noproxy '*' ${ISOMESH_TOKEN:+--header "Authorization: Bearer $ISOMESH_TOKEN"} \
  --write-out '%{http_code}' --output "$part" "$server/v1/jobs/$job/mesh.stl")"
if [[ "$status" != 200 ]]; then
  echo "mesh.sh: the mesh of job $job cannot be fetched: status $status: $(member detail "$(cat -- "$part")")" >&2
  exit 1
fi
mv -- "$part" "$output"
echo "$output"
