#include "server/import/labels/closed_ends.h"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <span>
#include <string>

namespace isomesh::import {
namespace {

using Dims = std::array<std::uint32_t, 3>;

// For each axis: the first and the last side.
using Sides = std::array<std::array<bool, 2>, 3>;

bool is_zero(std::span<const std::byte> bytes) {
  return std::ranges::all_of(bytes, [](std::byte byte) { return byte == std::byte{0}; });
}

Sides touched_sides(std::span<const std::byte> samples, const Dims& dims, std::size_t sample) {
  Sides touched = {};
  for (std::size_t axis = 0; axis < 3; ++axis) touched[axis].fill(dims[axis] == 1);
  const std::size_t row_bytes = dims[0] * sample;
  for (std::uint32_t k = 0; k < dims[2]; ++k) {
    for (std::uint32_t j = 0; j < dims[1]; ++j) {
      const auto row = samples.subspan((std::size_t{k} * dims[1] + j) * row_bytes, row_bytes);
      touched[0][0] = touched[0][0] || !is_zero(row.first(sample));
      touched[0][1] = touched[0][1] || !is_zero(row.last(sample));
      const std::array<std::array<bool, 2>, 2> is_at = {
          {{j == 0, j + 1 == dims[1]}, {k == 0, k + 1 == dims[2]}}};
      for (const std::size_t axis : {1, 2}) {
        for (const std::size_t side : {0, 1}) {
          if (!is_at[axis - 1][side] || touched[axis][side]) continue;
          touched[axis][side] = !is_zero(row);
        }
      }
    }
  }
  return touched;
}

Dims grown(Dims dims, const Sides& sides) {
  for (std::size_t axis = 0; axis < 3; ++axis) dims[axis] += sides[axis][0] + sides[axis][1];
  return dims;
}

// From the last row to the first, in place: no row moves to the front.
void move_rows(std::span<std::byte> samples, const Dims& from, const Dims& to, const Sides& sides,
               std::size_t sample) {
  const std::size_t row_bytes = from[0] * sample;
  std::size_t zeros_end = samples.size();  // everything from here on is in its place
  for (std::size_t row = std::size_t{from[1]} * from[2]; row-- > 0;) {
    const std::size_t k = row / from[1] + sides[2][0];
    const std::size_t j = row % from[1] + sides[1][0];
    const std::size_t place = ((k * to[1] + j) * to[0] + sides[0][0]) * sample;
    std::memmove(samples.data() + place, samples.data() + row * row_bytes, row_bytes);
    std::ranges::fill(samples.subspan(place + row_bytes, zeros_end - place - row_bytes),
                      std::byte{0});
    zeros_end = place;
  }
  std::ranges::fill(samples.first(zeros_end), std::byte{0});
}

void add_note(std::size_t planes, Volume& volume) {
  if (planes == 0) return;
  const std::string detail = "Labels reach the end of the segmentation at " +
                             std::to_string(planes) + (planes == 1 ? " side" : " sides") +
                             ". A plane of zeros was added there.";
  const auto known =
      std::ranges::find(volume.notes, describe(NoteCode::kEmptyPlanes).name, &Note::code);
  if (known == volume.notes.end()) {
    volume.notes.push_back(note_of(NoteCode::kEmptyPlanes, detail));
  } else {
    known->detail += ' ' + detail;
  }
}

}  // namespace

std::array<std::uint32_t, 3> with_room(const std::array<std::uint32_t, 3>& dims, SampleType type,
                                       const SizeLimits& limits) {
  std::array<std::uint64_t, 3> sizes = {dims[0], dims[1], dims[2]};
  for (std::uint64_t& size : sizes) size += 2;
  const Dims room = volume_dims(sizes);
  check_limits(sizes[0] * sizes[1] * sizes[2], type, limits);
  return room;
}

void close_ends(CanonicalWriter& writer, Volume& volume) {
  const std::size_t sample = bytes_per_sample(volume.type);
  const Dims before = volume.dims;
  const Sides sides = touched_sides(writer.samples(), before, sample);
  volume.dims = grown(before, sides);
  std::size_t planes = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto& [first, last] = sides[static_cast<std::size_t>(axis)];
    planes += std::size_t{first} + std::size_t{last};
    if (!first) continue;
    const Vector3 step = step_of(volume.geometry, axis);
    for (std::size_t row = 0; row < 3; ++row) volume.geometry.origin[row] -= step[row];
  }
  if (const auto fault = find_fault(volume.dims, volume.geometry)) {
    throw_unusable("The segmentation cannot be closed at its ends: " + fault->message + ".");
  }
  const volume::CanonicalHeader header = {volume.dims, volume.type, volume.geometry};
  if (planes > 0) {
    move_rows(writer.samples().first(header.sample_bytes()), before, volume.dims, sides, sample);
  }
  writer.shorten(header);
  add_note(planes, volume);
}

}  // namespace isomesh::import
