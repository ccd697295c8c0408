// Names. Thread safe.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>

namespace isomesh {

// Lower-case hexadecimal from the system's random source, two digits per byte. Throws Error
// kInternal if that fails, as time_ordered_id() does.
std::string random_hex(std::size_t bytes);

// Returns a UUID of version 7 (RFC 9562). It sorts after all earlier ones of this process. Ids of
// several processes are ordered as far as their clocks agree.
std::string time_ordered_id(
    std::chrono::system_clock::time_point now = std::chrono::system_clock::now());

// Sorts before all time-ordered ids of that time and later ones, and after those of earlier
// milliseconds.
std::string first_id_at(std::chrono::system_clock::time_point time);

// This machine's name; "-" if it has none.
std::string host_name();

}  // namespace isomesh
