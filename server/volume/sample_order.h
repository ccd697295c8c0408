// Moves the samples of a volume into another order of axes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stop_token>

#include "proto/types.h"
#include "server/volume/geometry.h"

namespace isomesh::volume {

// Puts samples with these sizes into `order`, in place: afterwards axis a is the present axis
// |order[a]|, reversed if the number is negative. `samples` has them with the first axis fastest,
// of 1, 2, 4 or 8 bytes each. Reads and writes all samples once to reverse axes, and two or three
// times to exchange axes. Takes the memory of a slice, of at most 64 MiB, and a bit for each row.
// Slices of more bytes take a bit for each of their samples instead. Looks at `stop` after each
// slice or row. Throws Error kCancelled, which leaves the samples in no order.
void put_in_order(std::span<std::byte> samples, std::size_t bytes_per_sample,
                  const std::array<std::uint32_t, 3>& dims, const AxisOrder& order,
                  const std::stop_token& stop = {});

// Makes the order of axes canonical (geometry.h): that of the samples, of which there may be more
// behind those of the volume, and of its dims and geometry. Throws Error kUnusableVolume, before
// samples move, if rounding leaves a geometry with a fault; kCancelled as put_in_order does.
void make_canonical(std::span<std::byte> samples, Volume& volume, const std::stop_token& stop = {});

}  // namespace isomesh::volume
