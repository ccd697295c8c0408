// Pages of image files: grey pictures of which several are a volume.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "server/import/source/source.h"

namespace isomesh::import {

struct PageLayout {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  StoredType type = StoredType::kUint8;

  std::uint64_t bytes() const { return std::uint64_t{width} * height * bytes_per_sample(type); }
  bool operator==(const PageLayout&) const = default;
};

// Called with a page's layout before its samples. Throws to refuse the page.
using PageCheck = std::function<void(const PageLayout& layout)>;

// Takes the samples of a page, row by row, in the byte order of this machine.
using PageSink = std::function<void(std::span<const std::byte> samples)>;

}  // namespace isomesh::import
