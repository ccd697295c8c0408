#include "server/jobs/library/volume_library.h"

#include <algorithm>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "base/clock.h"
#include "base/hex.h"
#include "base/sha256.h"
#include "proto/error.h"
#include "proto/json.h"
#include "server/jobs/library/intact_volume.h"
#include "server/volume/canonical.h"
#include "server/volume/geometry.h"
#include "server/volume/sample_order.h"
#include "server/volume/unusable.h"

namespace isomesh::jobs {
namespace {

constexpr std::size_t kLongestName = 255;

// True if the upload was rejected only because it has several volumes.
bool leaves_members_open(const Error& error, const ImportOptions& options) {
  const std::vector<Choice>& choices = error.remedy().choices;
  return options.member.empty() && !choices.empty() && choices.front().parameter == "member";
}

// The id of a volume: the digest of what its upload says. It has a key if that concerns a person:
// without one, anyone who sees an id, for instance in a log, could test whose it is. The format,
// the order of axes and the names of files say nothing of the volume.
std::string id_of(Volume volume, const std::string& key) {
  volume.name.reset();
  volume.format.clear();
  volume.stored_axes.reset();
  volume.ignored.clear();
  const std::string said = to_full_json(volume);
  return volume.dicom ? to_hex(hmac_sha256(key, said)) : sha256_of(said);
}

// One name for several volumes needs the member's beside it.
UploadName name_of_member(const UploadName& name, const std::string& member) {
  if (!name.is_chosen) return name;
  std::string both = name.text + ": " + member;
  return {both.size() <= kLongestName ? std::move(both) : name.text, true};
}

std::filesystem::path canonical_in(const store::ScratchFolder& scratch) {
  return scratch.path() / "canonical";
}

// Before and after the axes.
constexpr std::string_view kOrientation =
    "The orientation was changed after the upload: the axes x, y, z of the samples have the "
    "directions that the file gives to ";
constexpr std::string_view kOrientationEnd = ".";

// The order of axes that earlier changes of the orientation add up to. Removes their note.
volume::AxisOrder take_orientation(std::vector<Note>& notes) {
  const auto note =
      std::ranges::find(notes, describe(NoteCode::kOrientationChanged).name, &Note::code);
  if (note == notes.end()) return volume::kFilesOrder;
  std::string_view detail = note->detail;
  detail.remove_prefix(std::min(kOrientation.size(), detail.size()));
  detail.remove_suffix(std::min(kOrientationEnd.size(), detail.size()));
  const auto order = volume::parse_axis_order(detail);
  if (!order) throw Error(ErrorCode::kInternal, "a note on the orientation names no axes");
  notes.erase(note);
  return *order;
}

// The directions in which the indices of the uploaded file increase, if those of a canonical volume
// increase in the directions `codes`.
std::string codes_of_file(const std::string& file, const std::string& codes) {
  constexpr std::string_view kForward = "LPS";
  constexpr std::string_view kBackward = "RAI";
  const auto opposite = [&](char letter) {
    const std::size_t at = kForward.find(letter);
    return at < kForward.size() ? kBackward[at] : kForward[kBackward.find(letter)];
  };
  std::string result;
  for (const char letter : file) {
    const std::size_t at = kForward.find(letter);
    result += at < kForward.size() ? codes.at(at) : opposite(codes.at(kBackward.find(letter)));
  }
  return result;
}

// Gives the lattice of the volume its new directions, and adds a note. The samples are still in the
// order of the old ones.
void turn(Volume& volume, const volume::AxisOrder& order) {
  volume.id.clear();
  volume.created.clear();
  const Geometry before = volume.geometry;
  volume.geometry = volume::reoriented(volume.dims, volume.geometry, order);
  if (const auto fault = volume::find_fault(volume.dims, volume.geometry)) {
    volume::throw_unusable("In this orientation, " + fault->message);
  }
  // The copy has the axes of the patient, so its note tells the changes of these. A volume of an
  // older version, and its note, may have the axes of its file.
  const volume::AxisOrder total =
      volume::along_patient(volume::in_turn(order, take_orientation(volume.notes)), before);
  if (volume.stored_axes) {
    volume.stored_axes = codes_of_file(*volume.stored_axes, volume::axis_codes(volume.geometry));
  }
  // A volume without these members of DICOM does not become the first one again.
  if (volume.dicom || total != volume::kFilesOrder) {
    volume.notes.push_back(note_of(
        NoteCode::kOrientationChanged,
        std::string(kOrientation) + volume::to_string(total) + std::string(kOrientationEnd)));
  }
  if (!volume.dicom) return;
  volume.dicom->frame_of_reference_uid.clear();
  volume.dicom->position_reference_indicator.clear();
  volume.dicom->instances.clear();
}

// Writes a canonical file of the same samples for the volume, whose geometry is another one. Puts
// its axes in order.
void copy_samples(const volume::CanonicalFile& from, Volume& volume,
                  const std::filesystem::path& path, const std::stop_token& stop) {
  constexpr std::size_t kCopiedAtOnce = std::size_t{4} << 20;
  volume::CanonicalWriter writer(path, from.header());
  std::span<std::byte> rest = writer.samples();
  std::uint64_t offset = 0;
  while (!rest.empty()) {
    if (stop.stop_requested()) throw_cancelled();
    const std::span<std::byte> piece = rest.first(std::min(kCopiedAtOnce, rest.size()));
    from.read(offset, piece);
    offset += piece.size();
    rest = rest.subspan(piece.size());
  }
  volume::make_canonical(writer.samples(), volume, stop);
  writer.shorten({volume.dims, volume.type, volume.geometry});
}

}  // namespace

std::pair<Volume, bool> VolumeLibrary::add(const std::string& owner,
                                           const std::filesystem::path& upload,
                                           const ImportOptions& options, const UploadName& name,
                                           const std::string& party, const ImportControl& control) {
  const store::ScratchFolder scratch(folder_.scratch());
  Volume volume = import_file(upload, options, party, scratch, control.cancelled);
  if (!name.text.empty() && (name.is_chosen || !volume.name)) volume.name = name.text;
  auto [stored, is_new] = keep(owner, std::move(volume), scratch, control);
  if (name.is_chosen && stored.name != name.text) {
    stored.name = volumes_.rename(owner, stored.id, name.text).name;
  }
  return {std::move(stored), is_new};
}

Volume VolumeLibrary::add_peers(const std::string& owner, const std::filesystem::path& response,
                                const PeersSeries& series, const ImportControl& control) {
  const store::ScratchFolder scratch(folder_.scratch());
  Volume volume = import_file(response, {.peers = series}, owner, scratch, control.cancelled);
  if (!volume.dicom) throw Error(ErrorCode::kInternal, "images from a PACS have no DICOM identity");
  return keep(owner, std::move(volume), scratch, control).first;
}

Volume VolumeLibrary::import_file(const std::filesystem::path& upload, const ImportOptions& options,
                                  const std::string& party, const store::ScratchFolder& scratch,
                                  const std::stop_token& cancelled) {
  try {
    return runner_.run({.source = upload,
                        .scratch = scratch.path(),
                        .target = canonical_in(scratch),
                        .options = options,
                        .limits = limits_},
                       party, cancelled);
  } catch (const Error&) {
    folder_.check_is_there();  // otherwise the file is not to blame
    throw;
  }
}

std::pair<Volume, bool> VolumeLibrary::keep(const std::string& owner, Volume volume,
                                            const store::ScratchFolder& scratch,
                                            const ImportControl& control) {
  const store::Blob blob = store::digest_of(canonical_in(scratch));
  if (control.cancelled.stop_requested()) throw_cancelled();
  // Also required if another owner has the same samples; otherwise the outcome on a full disk would
  // reveal that.
  if (!volumes_.has_samples(owner, blob.key)) {
    retention_.make_room({.owner = owner, .bytes = blob.bytes});
  }
  // The store keeps the blob for mark_named(), so nobody has to wait for it.
  try {
    runner_.until_stopped(control.cancelled, [&](const std::stop_token& stop) {
      blobs_.adopt(canonical_in(scratch), blob, owner, stop);
    });
  } catch (const Error& error) {
    // A remote store may have the bytes nevertheless.
    if (error.code() == ErrorCode::kCancelled) {
      eraser_.erase([&](const store::BlobsGoing& going) { going(std::span(&blob.key, 1)); });
    }
    throw;
  }
  volume.samples = blob.key;
  volume.id = id_of(volume, volumes_.key());
  volume.created = timestamp();
  auto [stored, is_new] = volumes_.add(owner, volume);
  if (control.stored) control.stored(volume.id);
  blobs_.mark_named(blob.key);
  // These are of the files of this upload.
  stored.format = std::move(volume.format);
  stored.stored_axes = std::move(volume.stored_axes);
  stored.ignored = std::move(volume.ignored);
  return {std::move(stored), is_new};
}

std::pair<Volume, bool> VolumeLibrary::reorient(const std::string& owner, const std::string& id,
                                                const volume::AxisOrder& order) {
  Volume volume = volumes_.get(owner, id);
  turn(volume, order);
  const store::ScratchFolder scratch(folder_.scratch());
  runner_.until_stopped({}, [&](const std::stop_token& stop) {
    const store::LocalBlob samples = intact_volume(blobs_, volume.samples, stop);
    copy_samples(volume::CanonicalFile(samples.path), volume, canonical_in(scratch), stop);
  });
  return keep(owner, std::move(volume), scratch, {});
}

std::vector<UploadedVolume> VolumeLibrary::add_all(const std::string& owner,
                                                   const std::filesystem::path& upload,
                                                   const ImportOptions& options,
                                                   const UploadName& name, const std::string& party,
                                                   const ImportControl& control) {
  const auto add_one = [&](const ImportOptions& how, const UploadName& called) {
    auto [volume, is_new] = add(owner, upload, how, called, party, control);
    return UploadedVolume{.member = how.member, .status = is_new ? 201 : 200, .volume = volume};
  };
  std::vector<Choice> members;
  try {
    return {add_one(options, name)};
  } catch (const Error& error) {
    if (!leaves_members_open(error, options)) throw;
    members = error.remedy().choices;
  }
  std::vector<UploadedVolume> volumes;
  for (const Choice& member : members) {
    ImportOptions how = options;
    how.member = member.value;
    try {
      volumes.push_back(add_one(how, name_of_member(name, member.value)));
    } catch (const Error& error) {
      if (error.code() == ErrorCode::kCancelled || describe(error.code()).status >= 500) throw;
      const Problem problem = to_problem(error, "");
      volumes.push_back({.member = member.value, .status = problem.status, .problem = problem});
    }
  }
  return volumes;
}

void VolumeLibrary::erase(const store::Viewer& viewer, const std::string& id, store::Made made) {
  eraser_.erase([&](const store::BlobsGoing& going) { volumes_.erase(viewer, id, made, going); });
}

bool VolumeLibrary::erase_job(store::JobStore& jobs, const store::Viewer& viewer,
                              const std::string& id) {
  bool has_ended = false;
  eraser_.erase([&](const store::BlobsGoing& going) { has_ended = jobs.erase(viewer, id, going); });
  return has_ended;
}

}  // namespace isomesh::jobs
