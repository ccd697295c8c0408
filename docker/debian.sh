# A bare Debian in a folder, for releases and for tests, which must not see this machine's packages. Needs root, debootstrap and the network.
# Sourced by scripts that set `root` to the checkout and define fail().

# make_debian SUITE FOLDER: debootstrap's smallest Debian, a copy of build/debian/SUITE, which is made the first time.
# The caller ends with remove_debian FOLDER.
make_debian() {
  local suite="$1" there="$2" base="$root/build/debian/$1" log="$root/build/debian/$1.log"
  [[ "$(id -u)" -eq 0 ]] || fail "needs root, for debootstrap and chroot"
  if [[ ! -d "$base" ]]; then
    mkdir -p "$root/build/debian"
    rm -rf "$base.part"
    debootstrap --variant=minbase "$suite" "$base.part" >"$log" 2>&1 || { tail "$log" >&2; fail "debootstrap $suite"; }
    mv "$base.part" "$base"
  fi
  cp -a "$base" "$there"
  cp /etc/resolv.conf "$there/etc/resolv.conf"
  # The machine's way to the network, such as a proxy that signs with its own authority.
  if compgen -G "/usr/local/share/ca-certificates/*.crt" >/dev/null; then
    mkdir -p "$there/usr/local/share/ca-certificates"
    cp /usr/local/share/ca-certificates/*.crt "$there/usr/local/share/ca-certificates/"
  fi
  # The machine's own package sources, if they are of that suite.
  if grep -qs "$suite" /etc/apt/sources.list.d/debian.sources; then
    cp /etc/apt/sources.list.d/debian.sources "$there/etc/apt/sources.list.d/"
    : >"$there/etc/apt/sources.list"
  fi
  mount -t proc proc "$there/proc"
  # Services are not started in there.
  printf '#!/bin/sh\nexit 101\n' >"$there/usr/sbin/policy-rc.d"
  chmod +x "$there/usr/sbin/policy-rc.d"
}

# share_compiler_cache FOLDER SOURCES: this machine's compiler cache in there, for a checkout at SOURCES. Sets `cached`, the
# environment of a build that takes it.
share_compiler_cache() {
  local there="$1" cache="${CCACHE_DIR:-$HOME/.cache/ccache}" name
  # ccache comes with its own libraries and loader: the Debian in there must not have a package more than a new user's.
  mkdir -p "$there/opt/ccache/cache" "$cache"
  cp /usr/bin/ccache "$there/opt/ccache/"
  ldd /usr/bin/ccache | grep -o '/[^ ]*' | xargs cp -L -t "$there/opt/ccache/"
  printf '#!/bin/sh\nexec /opt/ccache/ld-linux-x86-64.so.2 --library-path /opt/ccache /opt/ccache/ccache "$@"\n' >"$there/opt/ccache/launch"
  chmod +x "$there/opt/ccache/launch"
  mount --bind "$cache" "$there/opt/ccache/cache"
  cached=(CMAKE_CXX_COMPILER_LAUNCHER=/opt/ccache/launch CCACHE_DIR=/opt/ccache/cache CCACHE_BASEDIR="$2" CCACHE_NOHASHDIR=1
    CCACHE_SLOPPINESS=pch_defines,time_macros)
  # The locale is part of the keys, too.
  for name in LANG LC_ALL LC_CTYPE LC_MESSAGES; do
    cached=(-u "$name" "${cached[@]}" ${!name:+"$name=${!name}"})
  done
}

# remove_debian FOLDER: also what make_debian did not finish.
remove_debian() {
  ! mountpoint --quiet "$1/opt/ccache/cache" || umount --lazy "$1/opt/ccache/cache"
  # Also if a process in there is still ending.
  ! mountpoint --quiet "$1/proc" || umount --lazy "$1/proc"
  rm -rf --one-file-system "$1"
}

# inside FOLDER COMMAND..: runs in that Debian, with nothing of this environment.
inside() {
  env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive chroot "$@"
}
