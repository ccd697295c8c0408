// How several parties share a number of places, so that none of them can take all.
#pragma once

#include <cstddef>
#include <string_view>

namespace isomesh {

// Whether a party that holds so many places may have one more of those that are free: while it
// holds fewer than are free. Alone it gets half, and however many take what they can, there is
// always a share for one more. The party "" is nobody in particular, and may take every place.
constexpr bool has_share(std::string_view party, std::size_t held, std::size_t free) {
  return party.empty() ? free > 0 : held < free;
}

}  // namespace isomesh
