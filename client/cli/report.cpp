#include "client/cli/report.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/text.h"
#include "client/cli/text.h"
#include "proto/json.h"
#include "proto/json_tree.h"
#include "proto/stages.h"

namespace isomesh::cli {
namespace {

using Row = std::vector<std::string>;
using Rows = std::vector<Row>;

std::string dims_of(const Volume& volume) {
  const auto& [x, y, z] = volume.dims;
  return std::to_string(x) + " x " + std::to_string(y) + " x " + std::to_string(z);
}

template <std::size_t N>
std::string listed(const std::array<double, N>& values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "" : ", ") + human_number(value);
  return text;
}

std::string percent(double part, double whole) {
  return whole > 0 ? fixed(100 * part / whole, 1) + " %" : "";
}

std::string iso_of(const JobParameters& parameters) {
  if (parameters.labels) return "labels";
  return parameters.iso ? human_number(*parameters.iso) : "otsu";
}

std::string subject_of(const JobParameters& parameters) {
  const auto& labels = parameters.labels;
  if (!labels) {
    return "iso " + iso_of(parameters) + ", " + std::string(to_string(parameters.interpolation));
  }
  return labels->is_all() ? "all labels" : std::to_string(labels->values.size()) + " labels";
}

// Lengths, areas and volumes with their unit.
class Units {
 public:
  explicit Units(const LengthUnit& unit) : unit_(unit.symbol) {}

  std::string length(double value, int digits) const { return fixed(value, digits) + ' ' + unit_; }
  std::string area(double value) const { return fixed(value, 1) + ' ' + square(); }
  std::string volume(double value) const { return fixed(value, 1) + ' ' + cubic(); }
  std::string square() const { return unit_ + "²"; }
  std::string cubic() const { return unit_ + "³"; }

 private:
  std::string unit_;
};

std::string extent(const MeshSummary& mesh, std::size_t axis, const Units& in) {
  return fixed(mesh.bounds[0][axis], 2) + " to " + in.length(mesh.bounds[1][axis], 2);
}

std::string topology_of(const MeshQuality& quality) {
  std::string text = quality.closed ? "closed" : "open";
  text += quality.manifold ? ", manifold" : ", not manifold";
  text += quality.oriented ? ", oriented" : ", not oriented";
  if (quality.genus) text += ", genus " + grouped(*quality.genus);
  return text;
}

std::string size_of(const MeshFile& file) {
  const std::string exact = grouped(file.bytes) + " B";
  return file.bytes < 1000 ? exact : human_bytes(file.bytes) + " (" + exact + ")";
}

void tell_iso(const MeshSummary& mesh, Rows& rows) {
  if (mesh.iso) rows.push_back({"iso-value", human_number(*mesh.iso)});
}

// Unless a surface encloses something, the sum over its triangles is not a volume.
void tell_volume(const MeshSummary& mesh, const Units& in, Rows& rows) {
  if (mesh.empty) return;
  if (!mesh.quality.encloses_volume) {
    rows.push_back(
        {"volume", mesh.quality.closed
                       ? "none: the triangles disagree about which side is outside"
                       : "none: the surface is open; --close caps it at the volume's border"});
    return;
  }
  const std::string after = mesh.simplified ? " simplified" : " smoothed";
  rows.push_back({"volume", in.volume(mesh.volume_mm3.extracted) + " extracted"});
  rows.push_back({"", in.volume(mesh.volume_mm3.smoothed) + after});
}

std::string way_of(const DistanceSummary& distances, const Units& in) {
  return in.length(distances.max_mm, 4) + " at most, " + in.length(distances.p99_mm, 4) +
         " for 99 %, " + in.length(distances.mean_mm, 4) + " on average";
}

std::string bound_of(const Simplification& simplified) {
  switch (simplified.bound_by) {
    case Simplification::Bound::kError:
      return "error";
    case Simplification::Bound::kTriangles:
      return "number of triangles";
    case Simplification::Bound::kTopology:
      break;
  }
  return "topology: fewer triangles would open or fold the surface, or change its boundary";
}

std::string pairs_text(std::uint64_t pairs) {
  return pairs == 1 ? "1 pair of triangles" : grouped(pairs) + " pairs of triangles";
}

std::string place_text(const std::array<double, 3>& place, const Units& in) {
  return fixed(place[0], 2) + ", " + fixed(place[1], 2) + ", " + in.length(place[2], 2);
}

void tell_crossings(const MeshSummary& mesh, const Units& in, Rows& rows) {
  if (const auto& untangled = mesh.untangled) {
    const std::string moved =
        pairs_text(untangled->pairs) + "; " + grouped(untangled->vertices) + " vertices moved back";
    rows.push_back({"untangled", untangled->pairs == 0 ? "nothing to do" : moved});
    if (untangled->left > 0) {
      rows.push_back({"", pairs_text(untangled->left) + " intersect as extracted"});
    }
  }
  const auto& found = mesh.quality.self_intersections;
  if (!found) return;
  std::string text = found->pairs == 0 ? "none" : pairs_text(found->pairs);
  if (!found->places.empty()) {
    text += ", the first at " + place_text(found->places.front(), in);
  }
  rows.push_back({"self-intersections", text});
}

void tell_thickness(const MeshSummary& mesh, const Units& in, Rows& rows) {
  if (!mesh.thickness) return;
  const Thickness& thickness = *mesh.thickness;
  if (!thickness.thinnest_mm || !thickness.place) {
    rows.push_back({"thin walls", "none: no place has another side behind it"});
    return;
  }
  // Rough surfaces have a wall of nearly nothing somewhere: how much is thin tells more.
  // Two labels have the area between them together, and each its own walls.
  const std::string share =
      mesh.labels.empty() ? ", " + percent(thickness.thin_area_mm2, mesh.area_mm2) : "";
  rows.push_back({"thin walls", in.area(thickness.thin_area_mm2) + " of the surface" + share});
  rows.push_back({"  thinnest", in.length(*thickness.thinnest_mm, 3) + " at " +
                                    place_text(*thickness.place, in)});
}

void tell_error(const MeshSummary& mesh, const Units& in, Rows& rows) {
  if (mesh.simplified) {
    rows.push_back({"simplified", "from " + grouped(mesh.simplified->triangles_before) +
                                      " triangles, bound by the " + bound_of(*mesh.simplified)});
  }
  if (!mesh.certificate) return;
  const MeshCertificate& certificate = *mesh.certificate;
  if (certificate.bound_mm) {
    rows.push_back({"proven", "no point of any file or of the extracted surface is more than " +
                                  in.length(*certificate.bound_mm, 4) + " from the other"});
  } else if (certificate.why_unproven) {
    rows.push_back({"not proven", *certificate.why_unproven});
  }
  rows.push_back({"certified", in.length(certificate.found_mm, 4) +
                                   " from the extracted surface, " + "measured on the " +
                                   std::string(to_string(certificate.file)) + " file"});
  rows.push_back({"  from the file", way_of(certificate.from_mesh, in)});
  rows.push_back({"  to the file", way_of(certificate.from_extracted, in)});
  if (certificate.budget_mm) {
    const ErrorBudget& budget = *certificate.budget_mm;
    rows.push_back({"  budget", in.length(budget.smoothing, 4) + " smoothing, " +
                                    in.length(budget.simplification, 4) + " simplification, " +
                                    in.length(budget.quantisation, 4) + " rounding"});
  }
}

std::string labels_report(const std::vector<LabelSummary>& labels, const Units& in) {
  bool are_closed = true;
  bool are_oriented = true;
  Rows rows = {{"label", "name", "triangles", in.cubic(), in.cubic() + " of voxels", "topology"}};
  for (const LabelSummary& label : labels) {
    std::string topology = label.closed ? "closed" : "open";
    if (!label.manifold) topology += ", not manifold";
    if (!label.oriented) topology += ", not oriented";
    rows.push_back({std::to_string(label.label), label.name.value_or(""), grouped(label.triangles),
                    label.encloses_volume() ? fixed(label.volume_mm3, 1) : "none",
                    fixed(label.voxels_mm3, 1), topology});
    are_closed = are_closed && label.closed;
    are_oriented = are_oriented && (label.oriented || !label.closed);
  }
  std::string text = in_columns(
      {Align::kRight, Align::kLeft, Align::kRight, Align::kRight, Align::kRight, Align::kLeft},
      rows);
  if (!are_closed) {
    text +=
        "\n  An open label encloses no volume: it touches the volume's border. --close caps it "
        "there.\n";
  }
  if (!are_oriented) {
    text +=
        "\n  A label that is not oriented encloses no volume: its triangles disagree about which "
        "side is outside.\n";
  }
  return text;
}

void write_paths(Json& place, const std::vector<std::filesystem::path>& paths) {
  json_values::make_array(place);
  for (const auto& path : paths) json_values::assign(json_values::append(place), path.string());
}

}  // namespace

std::string timing_report(const Timing& timing, const ClientTiming& client) {
  Rows rows = {{"stage", "time", "share"}};
  const auto stage = [&](const std::string& name, double milliseconds) {
    rows.push_back({name, human_duration(milliseconds), percent(milliseconds, timing.total)});
  };
  if (client.upload) rows.push_back({"upload", human_duration(*client.upload)});
  for (const StageRow& row : kStages) {
    if (row.elapsed == nullptr || (!row.is_always_run && timing.*row.elapsed == 0)) continue;
    stage(row.name, timing.*row.elapsed);
  }
  stage("total", timing.total);
  if (client.download) rows.push_back({"download", human_duration(*client.download)});
  return in_columns({Align::kLeft, Align::kRight, Align::kRight}, rows);
}

std::string mesh_report(const MeshSummary& mesh, const LengthUnit& unit) {
  const Units in(unit);
  Rows rows;
  tell_iso(mesh, rows);
  const Rows sizes = {
      {"triangles", grouped(mesh.triangles)},
      {"vertices", grouped(mesh.vertices)},
      {"boundary edges", grouped(mesh.boundary_edges)},
      {"components", grouped(mesh.components)},
      {"Euler number", grouped(mesh.euler)},
      {"area", in.area(mesh.area_extracted_mm2) + " extracted"},
      {"", in.area(mesh.area_mm2) + (mesh.simplified ? " simplified" : " smoothed")}};
  rows.insert(rows.end(), sizes.begin(), sizes.end());
  tell_volume(mesh, in, rows);
  const Rows places = {{"displacement", in.length(mesh.displacement_mm.mean, 3) + " on average, " +
                                            in.length(mesh.displacement_mm.max, 3) + " at most"},
                       {"x (LPS)", extent(mesh, 0, in)},
                       {"y", extent(mesh, 1, in)},
                       {"z", extent(mesh, 2, in)}};
  rows.insert(rows.end(), places.begin(), places.end());
  tell_error(mesh, in, rows);
  if (mesh.dropped.components > 0) {
    rows.push_back({"dropped", grouped(mesh.dropped.components) + " components of " +
                                   grouped(mesh.dropped.triangles) + " triangles"});
  }
  const MeshQuality& quality = mesh.quality;
  rows.push_back({"topology", topology_of(quality)});
  tell_crossings(mesh, in, rows);
  tell_thickness(mesh, in, rows);
  rows.push_back({"aspect ratio", fixed(quality.aspect_ratio.extracted.mean, 3) + " extracted, " +
                                      fixed(quality.aspect_ratio.smoothed.mean, 3) + " smoothed"});
  rows.push_back({"smallest angle", fixed(quality.smallest_angle_deg.extracted.mean, 1) +
                                        "° extracted, " +
                                        fixed(quality.smallest_angle_deg.smoothed.mean, 1) +
                                        "° smoothed, on average"});
  for (const auto& [format, file] : mesh.files) {
    rows.push_back({"mesh." + std::string(to_string(format)), size_of(file)});
  }
  std::string text = in_columns({Align::kLeft, Align::kLeft}, rows);
  return mesh.labels.empty() ? text : text + '\n' + labels_report(mesh.labels, in);
}

std::string volume_report(const Volume& volume) {
  const std::string unit(length_unit(volume.notes).symbol);
  Rows rows = {{"volume", volume.id},
               {"name", volume.name.value_or("none")},
               {"format", volume.format},
               {"samples", dims_of(volume) + " " + std::string(to_string(volume.type)) + ", " +
                               human_bytes(volume.bytes)},
               {"spacing", listed(volume.geometry.spacing) + ' ' + unit},
               {"origin", listed(volume.geometry.origin) + ' ' + unit + " (LPS)"},
               {"direction", listed(volume.geometry.direction)},
               {"axes in the file", volume.stored_axes.value_or("unknown")},
               {"range", human_number(volume.range[0]) + " to " + human_number(volume.range[1])},
               {"suggested iso", human_number(volume.suggested_iso)}};
  if (volume.modality) rows.push_back({"modality", *volume.modality});
  for (const Preset& preset : volume.presets) {
    rows.push_back({"iso of " + preset.name, human_number(preset.iso)});
  }
  rows.push_back({"created", volume.created});
  for (const Note& note : volume.notes)
    rows.push_back({"note", with_options(note.detail) + " (" + note.code + ')'});
  for (const IgnoredObject& object : volume.ignored) {
    rows.push_back({"ignored", object.name + ": " + object.reason});
  }
  return in_columns({Align::kLeft, Align::kLeft}, rows);
}

std::string remedy_report(const Remedy& remedy) {
  constexpr std::size_t kMost = 50;
  Rows rows;
  for (const Choice& choice : remedy.choices) {
    if (rows.size() == kMost) break;
    // A shell takes the whole line, whose title is a comment.
    rows.push_back({"  " + shell_word("--" + choice.parameter) + ' ' + shell_word(choice.value),
                    choice.title.empty() ? "" : "# " + choice.title});
  }
  if (remedy.choices.size() > kMost) {
    rows.push_back({"  and " + std::to_string(remedy.choices.size() - kMost) + " more"});
  }
  std::string text = rows.empty() ? "" : in_columns({Align::kLeft, Align::kLeft}, rows);
  if (!remedy.overridable.empty()) text += "  --accept " + shell_word(remedy.overridable) + '\n';
  return text;
}

std::string histogram_report(const Histogram& histogram) {
  constexpr std::array kBars = {" ",      "\u2581", "\u2582", "\u2583", "\u2584",
                                "\u2585", "\u2586", "\u2587", "\u2588"};
  double most = 0;
  for (const std::uint64_t count : histogram.counts) {
    most = std::max(most, std::log1p(static_cast<double>(count)));
  }
  std::string bars;
  for (const std::uint64_t count : histogram.counts) {
    const double share = most > 0 ? std::log1p(static_cast<double>(count)) / most : 0;
    // A count above zero always gets a bar.
    bars += kBars.at(static_cast<std::size_t>(std::ceil(share * (kBars.size() - 1))));
  }
  return "\n  " + bars + "\n  " + human_number(histogram.range[0]) + " to " +
         human_number(histogram.range[1]) + ", logarithmic numbers of samples\n";
}

std::string estimate_report(const Estimate& estimate) {
  Rows rows = {{"triangles", grouped(estimate.triangles)},
               {"vertices", grouped(estimate.vertices)}};
  if (estimate.simplified_triangles) {
    rows.push_back(
        {"simplified", "about " + grouped(*estimate.simplified_triangles) + " triangles"});
  }
  for (const auto& [format, bytes] : estimate.bytes) {
    rows.push_back({std::string(to_string(format)), "about " + human_bytes(bytes)});
  }
  rows.push_back(
      {"memory", "about " + human_bytes(estimate.memory_bytes) +
                     (estimate.fits ? "" : ", more than the server allows for one job")});
  rows.push_back({"time", "about " + fixed(estimate.milliseconds / 1000, 1) + " s"});
  rows.push_back({"queue", std::to_string(estimate.queue.queued) + " waiting, " +
                               std::to_string(estimate.queue.running) + " running"});
  return in_columns({Align::kLeft, Align::kLeft}, rows);
}

std::string job_report(const Job& job, const LengthUnit& unit) {
  const JobParameters& asked = job.parameters;
  Rows rows = {{"job", job.id}, {"state", std::string(to_string(job.state))}};
  if (!is_final(job.state)) {
    rows.push_back(
        {"stage", std::string(to_string(job.stage)) + ", " + fixed(100 * job.progress, 0) + " %"});
  }
  rows.push_back({"volume", asked.volume});
  rows.push_back({"parameters",
                  subject_of(asked) + ", scheme " + std::string(to_string(asked.scheme)) +
                      (asked.regularize ? ", regularized, " : ", ") + std::to_string(asked.passes) +
                      " passes of " + std::string(to_string(asked.smoothing)) +
                      (asked.close ? ", closed" : "")});
  rows.push_back({"priority", std::string(to_string(asked.priority))});
  rows.push_back({"created", job.created});
  if (job.started) rows.push_back({"started", *job.started});
  if (job.finished) rows.push_back({"finished", *job.finished});
  if (job.reused) rows.push_back({"mesh", "reused from an identical earlier job"});
  if (job.error) {
    rows.push_back({"error", job.error->detail.empty() ? job.error->title : job.error->detail});
  }
  std::string text = in_columns({Align::kLeft, Align::kLeft}, rows);
  if (is_final(job.state)) text += '\n' + timing_report(job.timing, {});
  if (job.mesh) text += '\n' + mesh_report(*job.mesh, unit);
  return text;
}

std::string job_list(const std::vector<Job>& jobs, const VolumeNames& names) {
  constexpr std::size_t kShortId = 12;
  Rows rows = {{"job", "state", "done", "iso", "priority", "created", "volume"}};
  for (const Job& job : jobs) {
    const auto name = names.find(job.parameters.volume);
    rows.push_back(
        {job.id, std::string(to_string(job.state)), fixed(100 * job.progress, 0) + " %",
         iso_of(job.parameters), std::string(to_string(job.parameters.priority)), job.created,
         name != names.end() ? name->second : job.parameters.volume.substr(0, kShortId)});
  }
  return in_columns({Align::kLeft, Align::kLeft, Align::kRight, Align::kRight, Align::kLeft,
                     Align::kLeft, Align::kLeft},
                    rows);
}

std::string volume_list(const std::vector<Volume>& volumes) {
  Rows rows = {{"volume", "format", "samples", "type", "size", "created", "name"}};
  for (const Volume& volume : volumes) {
    rows.push_back({volume.id, volume.format, dims_of(volume), std::string(to_string(volume.type)),
                    human_bytes(volume.bytes), volume.created, volume.name.value_or("")});
  }
  return in_columns({Align::kLeft, Align::kLeft, Align::kRight, Align::kLeft, Align::kRight,
                     Align::kLeft, Align::kLeft},
                    rows);
}

std::string label_list(const VolumeLabels& labels) {
  Rows rows = {{"label", "voxels", "mm3", "color", "name"}};
  for (const VolumeLabel& label : labels.labels) {
    rows.push_back({std::to_string(label.label), grouped(label.voxels), fixed(label.volume_mm3, 1),
                    label.color.value_or(""), label.name.value_or("")});
  }
  return in_columns({Align::kRight, Align::kRight, Align::kRight, Align::kLeft, Align::kLeft},
                    rows);
}

std::string wall_list(const std::vector<WallSummary>& walls, const LengthUnit& unit) {
  Rows rows = {{"label", "name", "label", "name", Units(unit).square()}};
  for (const WallSummary& wall : walls) {
    const std::string other = wall.b ? std::to_string(*wall.b) : "";
    rows.push_back({std::to_string(wall.a), wall.a_name.value_or(""), other,
                    wall.b ? wall.b_name.value_or("") : "background", fixed(wall.area_mm2, 1)});
  }
  return in_columns({Align::kRight, Align::kLeft, Align::kRight, Align::kLeft, Align::kRight},
                    rows);
}

std::string with_origin(const std::string& json, const Origin& origin) {
  using namespace json_values;
  JsonTree tree(json);
  if (!origin.input.empty()) assign(member(tree.root(), "input"), origin.input);
  if (!origin.member.empty()) assign(member(tree.root(), "member"), origin.member);
  return dump(tree.root());
}

std::string job_json(const Job& job, const std::vector<std::filesystem::path>& outputs,
                     const ClientTiming& client, const Origin& origin) {
  using namespace json_values;
  JsonTree tree(to_json(job));
  write_paths(member(tree.root(), "outputs"), outputs);
  Json& times = member(tree.root(), "client");
  make_object(times);
  if (client.upload) assign(member(times, "upload"), *client.upload);
  if (client.download) assign(member(times, "download"), *client.download);
  return with_origin(dump(tree.root()), origin);
}

std::string failure_json(const Error& error, const Origin& origin) {
  Problem problem = to_problem(error, "");
  problem.detail = error.what();  // also of an error of the client's own
  return with_origin("{\"error\":" + to_json(problem) + '}', origin);
}

std::string skipped_json(const std::vector<std::filesystem::path>& outputs, const Origin& origin) {
  using namespace json_values;
  JsonTree tree;
  make_object(tree.root());
  assign(member(tree.root(), "skipped"), true);
  write_paths(member(tree.root(), "outputs"), outputs);
  return with_origin(dump(tree.root()), origin);
}

}  // namespace isomesh::cli
