// Names that nobody else gives. Thread safe; all throw Error kInternal when the system has no
// random bytes.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>

namespace isomesh {

// Lower-case hexadecimal from the system's random source, two digits a byte.
std::string random_hex(std::size_t bytes);

// A name that sorts after all that this process made before: a UUID of version 7 (RFC 9562). Those
// of several processes are in order as far as they give the time of one clock.
std::string time_ordered_id(
    std::chrono::system_clock::time_point now = std::chrono::system_clock::now());

}  // namespace isomesh
