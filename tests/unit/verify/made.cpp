#include "tests/unit/verify/made.h"

#include <algorithm>
#include <stdexcept>

#include "server/jobs/making/crop.h"
#include "server/jobs/making/make_mesh.h"
#include "tests/support/files.h"

namespace isomesh::test {
namespace {

std::string bytes_of(const verify::Vec& p) {
  return test::bytes_of(std::vector<float>{static_cast<float>(p[0]), static_cast<float>(p[1]),
                                           static_cast<float>(p[2])});
}

}  // namespace

Made made_with_word(const SampleVolume<float>& volume, const MeshParameters& parameters) {
  Volume record;
  record.dims = {volume.dims.x, volume.dims.y, volume.dims.z};
  record.type = SampleType::kFloat32;
  record.geometry = volume.geometry;
  const jobs::SampleArray whole = {record.type, record.dims, record.geometry,
                                   reinterpret_cast<const std::byte*>(volume.samples.data())};
  const jobs::CroppedSamples cropped(whole, parameters);
  const jobs::MeshRequest request = {
      record, parameters, parameters.iso.value(), {.certify = true}, std::uint64_t{4} << 30};
  std::string file;
  const codec::Sink sink = [&](std::span<const std::byte> bytes) {
    file.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  };
  const jobs::Report unheard = [](Stage, double, const Timing&) {};
  jobs::Progress progress({}, unheard, {});
  mesh::Mesh mesh;
  const MeshSummary summary =
      jobs::make_mesh(cropped.array(), request, std::span(&sink, 1), progress, mesh);
  return {file, summary.certificate && summary.certificate->bound_mm};
}

std::string made(const SampleVolume<float>& volume, const MeshParameters& parameters) {
  return made_with_word(volume, parameters).file;
}

MeshParameters parameters_within(double bound) {
  MeshParameters parameters;
  parameters.iso = 0;
  parameters.passes = 0;
  parameters.formats = {MeshFormat::kStl};
  parameters.glb_codec = GlbCodec::kNone;
  parameters.max_error_mm = bound;
  return parameters;
}

verify::Field field_of(const SampleVolume<float>& volume) {
  verify::Field field;
  field.dims = {volume.dims.x, volume.dims.y, volume.dims.z};
  field.values.assign(volume.samples.begin(), volume.samples.end());
  const mesh::LatticeToSpace space = volume.lattice().to_space;
  field.origin = space.origin;
  field.steps = {space.step_x, space.step_y, space.step_z};
  return field;
}

verify::Verdict verdict(verify::Surface mesh, const SampleVolume<float>& volume,
                        const MeshParameters& parameters) {
  verify::Field field = field_of(volume);
  if (parameters.crop) field = field.cropped(*parameters.crop);
  verify::Cut cut;
  cut.iso = parameters.iso.value();
  cut.tetrahedra = parameters.scheme == SchemeName::kFive ? 5 : 6;
  cut.close = parameters.close;
  cut.midpoint = parameters.interpolation == Interpolation::kMidpoint;
  if (parameters.inside == Inside::kBelow) verify::turn_over(cut, field);
  if (parameters.fill_cavities) verify::fill_cavities(cut, field);
  verify::Surface surface = verify::zero_set(field, cut);
  verify::Question question;
  question.bound = parameters.max_error_mm.value_or(0.001);
  question.is_closed = cut.close;
  question.components = parameters.components;
  return verify::verify(mesh, surface, field, question);
}

SampleVolume<float> balls() {
  const Field large = sphere({5, 5, 5}, 4.1);
  const Field hollow = sphere({5, 5, 5}, 2.1);
  const Field small = sphere({11, 5, 5}, 1.2);
  Geometry geometry;
  geometry.spacing = {0.5, 0.5, 0.5};
  return sample<float>(
      [&](const Point& p) { return std::max(std::min(large(p), -hollow(p)), small(p)); },
      {28, 21, 21}, geometry);
}

std::string stl_of(const verify::Surface& surface) {
  std::string file(80, ' ');
  file += test::bytes_of(std::vector{static_cast<std::uint32_t>(surface.triangles.size())});
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    file += bytes_of({0, 0, 0});
    for (const verify::Vec& corner : surface.corners(t)) file += bytes_of(corner);
    file += std::string(2, '\0');
  }
  return file;
}

}  // namespace isomesh::test
