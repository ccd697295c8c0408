// Fair sharing of a limited number of places.
#pragma once

#include <cstddef>
#include <string_view>

namespace isomesh {

// True if a party that holds `held` places may take one of the `free` ones: while it holds fewer
// than are free. One party alone gets half, and however many parties compete, a share remains for
// one more. The party "" is anonymous and may take every place.
constexpr bool has_share(std::string_view party, std::size_t held, std::size_t free) {
  return party.empty() ? free > 0 : held < free;
}

}  // namespace isomesh
