#include <algorithm>
#include <cmath>
#include <string>

#include "base/text.h"
#include "server/import/dicom/elements/csa_header.h"
#include "server/import/dicom/elements/private_elements.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/geometry/attributes.h"
#include "server/import/dicom/geometry/vectors.h"
#include "server/import/dicom/kinds/placed_frames.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

constexpr std::uint32_t kMostTiles = 4096;
// The largest difference between the image's normal and that of the CSA header.
constexpr double kParallel = 1e-2;

bool has_image_type(const DataSet& data, std::string_view type) {
  const auto types = data.texts(kImageType);
  return std::ranges::find(types, type) != types.end();
}

bool is_grid(const DataSet& data) { return data.find(kGridImages) != nullptr; }

struct Tiling {
  std::uint32_t slices = 0;
  std::uint32_t columns = 0;
  std::uint32_t rows = 0;
};

std::uint32_t checked_count(double count) {
  if (count >= 1 && count <= kMostTiles && std::floor(count) == count) {
    return static_cast<std::uint32_t>(count);
  }
  throw_unusable("The DICOM image is a mosaic of " + to_text(count) +
                 " slices, which is not a valid number of slices.");
}

Tiling tiling_of(double count, bool is_square) {
  Tiling tiling;
  tiling.slices = checked_count(count);
  tiling.columns = static_cast<std::uint32_t>(std::ceil(std::sqrt(tiling.slices)));
  tiling.rows = is_square ? tiling.columns : (tiling.slices + tiling.columns - 1) / tiling.columns;
  return tiling;
}

void cut(const Tiling& tiling, Image& image) {
  const PixelLayout& whole = image.stored;
  if (whole.bits_allocated < 8) throw_unusable("The DICOM image is a mosaic of single bits.");
  if (whole.columns % tiling.columns != 0 || whole.rows % tiling.rows != 0) {
    throw_unusable("The DICOM image is a mosaic of " + std::to_string(tiling.slices) +
                   " slices, but its " + std::to_string(whole.columns) + " x " +
                   std::to_string(whole.rows) + " samples cannot be divided into " +
                   std::to_string(tiling.columns) + " x " + std::to_string(tiling.rows) +
                   " tiles.");
  }
  image.layout.columns = whole.columns / tiling.columns;
  image.layout.rows = whole.rows / tiling.rows;
  image.tiles_per_row = tiling.columns;
  const Frame first = image.frames.front();
  image.frames.assign(tiling.slices, first);
  for (std::uint32_t tile = 0; tile < tiling.slices; ++tile) image.frames[tile].number = tile;
}

// The Siemens headers: of the image, and the protocol in that of the series.
struct SiemensHeaders {
  CsaHeader image;
  std::optional<ProtocolSlices> protocol;
};

SiemensHeaders siemens_headers(const DataSet& data) {
  SiemensHeaders headers;
  if (const Element* image = data.find(kCsaImageHeader)) {
    headers.image = parse_csa_header(image->value);
  }
  if (const Element* series = data.find(kCsaSeriesHeader)) {
    headers.protocol = protocol_slices(series->value);
  }
  return headers;
}

double slice_count(const DataSet& data, const SiemensHeaders& headers) {
  if (const auto told = csa_numbers(headers.image, "NumberOfImagesInMosaic"); !told.empty()) {
    return told.front();
  }
  if (const auto told = data.unsigned_number(kMosaicImages)) return *told;
  if (headers.protocol) return headers.protocol->count;
  throw_unusable(
      "The DICOM image is a mosaic, but its number of slices is unknown: it has no Siemens header "
      "(0029,1010) or (0029,1020).");
}

void refuse_other_normal(double along) {
  if (std::abs(std::abs(along) - 1) <= kParallel) return;
  throw_unusable("The DICOM image is a mosaic, but its slices are not stacked along their normal.");
}

// The direction from the first tile to the last, which lies at an end of the protocol's slices. The
// protocol's order may be the reverse of the tiles', so the position of the first tile decides.
Vector3 protocol_normal(const ProtocolSlices& slices, const Vector3& corner, const Vector3& own) {
  refuse_other_normal(dot(own, unit_vector(slices.normal.data())));
  const double to_first = std::abs(dot(difference(slices.first, corner), own));
  const double to_last = std::abs(dot(difference(slices.last, corner), own));
  const double extent = dot(difference(slices.last, slices.first), own);
  // Scanners move slices with the patient, so the position may be that of no slice.
  if (slices.count > 1 && !(std::min(to_first, to_last) < std::abs(extent) / 4)) {
    throw_unusable(
        "The DICOM image is a mosaic, but the order of its slices is unknown: its position is at "
        "neither end of the slices in its Siemens header (0029,1020).");
  }
  return moved({}, own, std::copysign(1, to_first <= to_last ? extent : -extent));
}

Vector3 slice_normal(const Plane& plane, const Vector3& corner, const SiemensHeaders& headers) {
  const auto told = csa_numbers(headers.image, "SliceNormalVector");
  const Vector3 own = cross(plane.along_row, plane.along_column);
  if (told.size() != 3) {
    if (headers.protocol) return protocol_normal(*headers.protocol, corner, own);
    throw_unusable(
        "The DICOM image is a mosaic, but the order of its slices is unknown: its Siemens header "
        "(0029,1010) has no SliceNormalVector.");
  }
  const double along = dot(own, unit_vector(told.data()));
  refuse_other_normal(along);
  return moved({}, own, std::copysign(1, along));
}

double slice_distance(const DataSet& data, const SiemensHeaders& headers, Image& image) {
  for (const auto& told :
       {data.numbers(kSpacingBetweenSlices), csa_numbers(headers.image, "SpacingBetweenSlices")}) {
    if (!told.empty() && told.front() > 0) return told.front();
  }
  if (headers.protocol && headers.protocol->count > 1) {
    const double extent = length(difference(headers.protocol->last, headers.protocol->first));
    if (extent > 0) return extent / (headers.protocol->count - 1);
  }
  image.is_distance_assumed = true;
  const auto thickness = data.numbers(kSliceThickness);
  if (!thickness.empty() && thickness.front() > 0) return thickness.front();
  throw_unusable("The DICOM image is a mosaic, but the distance between its slices " +
                 tag_name(kSpacingBetweenSlices) + " is unknown.");
}

void unfold_siemens(const DataSet& data, Image& image) {
  const SiemensHeaders headers = siemens_headers(data);
  const Tiling tiling = tiling_of(slice_count(data, headers), true);
  const Plane plane = image.frames.front().plane;
  cut(tiling, image);
  const auto half_less = [](std::uint32_t whole, std::uint32_t tile) {
    return (static_cast<double>(whole) - static_cast<double>(tile)) / 2;
  };
  const double across = half_less(image.stored.columns, image.layout.columns) * plane.spacing[0];
  const double down = half_less(image.stored.rows, image.layout.rows) * plane.spacing[1];
  const Vector3 corner =
      moved(moved(plane.position, plane.along_row, across), plane.along_column, down);
  const Vector3 normal = slice_normal(plane, corner, headers);
  const double distance = slice_distance(data, headers, image);
  for (Frame& frame : image.frames) {
    frame.plane.position = moved(corner, normal, distance * frame.number);
  }
}

void unfold_united_imaging(const DataSet& data, Image& image) {
  const auto count = data.numbers(kGridImages);
  const Tiling tiling = tiling_of(count.empty() ? 0 : count.front(), false);
  const auto places = data.items(kGridFrames);
  if (places.size() != tiling.slices) {
    throw_unusable("The DICOM image is a grid of " + std::to_string(tiling.slices) +
                   " slices, but it describes " + std::to_string(places.size()) + ' ' +
                   tag_name(kGridFrames) + ".");
  }
  cut(tiling, image);
  for (Frame& frame : image.frames) {
    const auto position = required_numbers(places[frame.number], kImagePosition, 3,
                                           "position of every slice in its grid");
    std::ranges::copy(position, frame.plane.position.begin());
  }
}

}  // namespace

bool is_placed_grid(const DataSet& data) {
  if (has_functional_groups(data) || !is_grid(data)) return false;
  return has_image_type(data, "VFRAME") || data.find(kGridFrames) != nullptr;
}

bool is_mosaic(const DataSet& data) {
  if (has_functional_groups(data)) return false;
  return is_grid(data) ? is_placed_grid(data) : has_image_type(data, "MOSAIC");
}

void unfold_mosaic(const DataSet& data, Image& image) {
  if (is_grid(data)) return unfold_united_imaging(data, image);
  unfold_siemens(data, image);
}

}  // namespace isomesh::import::dicom
