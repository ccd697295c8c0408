// Orders: images from a PACS are meshed, and the meshes are stored there.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/error.h"
#include "proto/types.h"

namespace isomesh {

enum class OrderState {
  kWaiting,    // for the series to be complete in the PACS
  kFetching,   // reading its instances
  kMeshing,    // its job is queued or runs
  kSending,    // storing the results in the PACS
  kSucceeded,  // all results are stored
  kFailed,
  kCancelled,
};

// True for the three states that an order does not leave on its own.
bool is_final(OrderState state);

std::string_view to_string(OrderState value);
template <>
std::optional<OrderState> from_string(std::string_view name);

struct OrderSource {
  std::string pacs;
  std::string study;
  std::string series;
  std::optional<std::uint32_t> instances = {};  // once the series is complete

  bool operator==(const OrderSource&) const = default;
};

// SOP class of most objects that orders make: those of STL.
inline constexpr std::string_view kEncapsulatedStlStorage = "1.2.840.10008.5.1.4.1.1.104.3";

// The kinds of DICOM objects that orders make.
enum class SendFormat {
  kStl,  // Encapsulated STL: one, or one for each label
  kObj,  // Encapsulated OBJ of all labels, and their materials
  kSr,   // a structured report of measurements on the meshes
  kSeg,  // a segmentation with the labels of the order's label volume
};

std::string_view to_string(SendFormat value);
template <>
std::optional<SendFormat> from_string(std::string_view name);
template <>
std::string names_of<SendFormat>();

// The file of a mesh from which such objects are made.
MeshFormat file_for(SendFormat format);

// The destination and the kind of objects.
struct SendTarget {
  std::string pacs;
  SendFormat format = SendFormat::kStl;

  bool operator==(const SendTarget&) const = default;
};

// One DICOM object for one PACS.
struct OrderResult {
  std::string pacs;
  SendFormat format = SendFormat::kStl;
  std::optional<std::int64_t> label = {};  // of an order by labels, for an object of one label
  std::string sop_class_uid{kEncapsulatedStlStorage};
  std::string series_uid;
  std::string sop_instance_uid;
  std::uint64_t bytes = 0;
  bool stored = false;  // the PACS confirmed it, and a query found it

  bool operator==(const OrderResult&) const = default;
};

struct Order {
  std::string id;
  OrderState state = OrderState::kWaiting;
  std::optional<std::string> rule = {};
  OrderSource source;
  MeshParameters parameters;
  Priority priority = Priority::kRoutine;
  std::vector<SendTarget> send;
  // An uploaded volume of labels on the grid of the series, which is meshed in its place.
  std::optional<std::string> label_volume = {};
  std::optional<std::string> volume = {};  // once fetched
  std::optional<std::string> job = {};
  std::vector<OrderResult> results;
  std::uint32_t attempts = 0;                    // failed attempts that are retried
  std::optional<std::string> next_attempt = {};  // RFC 3339, UTC, like all times
  std::string created;
  std::optional<std::string> finished = {};
  std::optional<Problem> error = {};  // of the order or of its last attempt

  bool operator==(const Order&) const = default;
};

// A workitem of a worklist (PS3.18, 11) that an order performs.
struct Workitem {
  std::string worklist;  // name of the PACS that has it
  std::string uid;
  std::string procedure;                // VALUE^SCHEME^MEANING
  std::string transaction;              // secret UID with which the order claims it
  bool claimed = false;                 // the worklist confirmed it
  std::optional<OrderState> told = {};  // the last step that the worklist was told of
  // The end of the order, which it enters when the worklist was told of it.
  std::optional<OrderState> ending = {};
  std::string patient_id = {};  // of its patient; empty if the worklist does not tell

  bool operator==(const Workitem&) const = default;
};

// Internal state of an order: in its record, never in a response.
struct OrderWork {
  std::vector<std::string> listed;          // SOP Instance UIDs of the series, ascending
  std::optional<std::string> listed_since;  // when this list was first seen
  // For images that were sent to us, as of the last fetch: SOP Instance UID, a blank, and a digest.
  std::vector<std::string> contents = {};
  std::uint32_t failures = 0;             // in a row; determines the back-off
  std::uint32_t looks = 0;                // in a row, for a series that is missing
  std::string begun;                      // when the order was accepted or restarted
  std::optional<DicomIdentity> identity;  // of the images that were fetched
  std::vector<std::string> blobs;         // of the objects, in the order of the results
  std::string label;                      // the mesh's label
  std::optional<std::int64_t> series_number;
  std::optional<std::string> callback;  // a URL
  // The bound of simplification that fits the mesh into the PACS's size limit.
  std::optional<double> max_error_mm = {};
  std::optional<std::uint32_t> triangles = {};  // the number that fits, if not all do
  std::optional<std::string> queried = {};      // when the query of the audit trail was recorded
  // The object that is being sent, or whose sending failed: the PACS, a blank, the SOP Instance
  // UID.
  std::optional<std::string> sending = {};
  // Since when its PACS says that it has this object, but does not list it.
  std::optional<std::string> confirmed = {};
  // The failures are forgotten once this step succeeds. Empty: there were none.
  std::optional<OrderState> failed_in = {};
  std::optional<Workitem> workitem = {};
  std::string segmented_series = {};  // of a segmentation: the series of its images, if known
  // The geometry of the images, if there is a label volume.
  std::optional<Geometry> image_geometry = {};

  bool operator==(const OrderWork&) const = default;
};

// An order as a client requests it. Its rule supplies omitted members.
struct OrderRequest {
  OrderSource source;
  std::optional<std::string> rule;
  std::optional<std::string> parameters;  // as JSON, unchecked: parse_order_parameters reads it
  std::optional<std::vector<SendTarget>> send;
  std::optional<std::string> label_volume = {};
  std::optional<Priority> priority;
  std::optional<Callback> callback;
};

// The state of a PACS since the service started.
struct PacsStatus {
  std::string name;
  std::optional<std::string> last_success = {};
  std::optional<std::string> last_failure = {};
  std::optional<std::string> reason = {};  // of that failure, in one word

  bool operator==(const PacsStatus&) const = default;
};

// A search for series of a PACS; empty members match everything.
struct SeriesQuery {
  std::string patient_id = {};    // * and ? are wildcards, as in the next
  std::string patient_name = {};  // as DICOM writes it: FAMILY^GIVEN
  std::string date = {};          // of the study: a day or a range of days as DICOM writes them
  std::string modality = {};
  std::string study = {};  // UID
  std::size_t limit = 20;  // the most studies
};

// A series that a PACS has, as it says. Texts are empty if it does not say.
struct PacsSeries {
  std::string study = {};  // UIDs
  std::string series = {};
  std::string patient_id = {};
  std::string patient_name = {};
  std::string study_date = {};  // as DICOM writes it: 20261130
  std::string study_description = {};
  std::string series_description = {};
  std::string modality = {};
  std::optional<std::uint32_t> instances = {};

  bool operator==(const PacsSeries&) const = default;
};

struct PacsSeriesList {
  std::vector<PacsSeries> series;
  bool complete = true;  // false: the PACS has more that match

  bool operator==(const PacsSeriesList&) const = default;
};

std::string to_json(const Order& order);
// {"orders": [...], "next": cursor}
std::string to_json(const std::vector<Order>& orders, const std::string& next = "");
// {"pacs": [...]}
std::string to_json(const std::vector<PacsStatus>& pacs);
std::string to_json(const PacsSeriesList& found);
// The body of a callback: no patients, no DICOM identifiers.
std::string to_callback_json(const Order& order);
std::string to_json(const OrderRequest& request);

// Reads a server's response. Throws Error kInternal if it does not follow the API.
Order order_from_json(std::string_view text);
std::vector<Order> orders_from_json(std::string_view text);
std::vector<PacsStatus> pacs_from_json(std::string_view text);
PacsSeriesList pacs_series_from_json(std::string_view text);

// For stores. Readers give missing members their defaults. They throw Error
// kInternal.
std::string to_record(const Order& order);
std::string to_record(const OrderWork& work);
Order order_from_record(std::string_view text);
OrderWork order_work_from_record(std::string_view text);

// Reads the body of POST /v1/orders. Throws Error kInvalidParameter that names each error.
OrderRequest parse_order_request(std::string_view body);

// The parameters of an order's job: `rules`, overridden by `own`. Both are JSON objects as in POST
// /v1/jobs without `volume`, `priority` and `callback`; "" is none. `formats` defaults to "stl".
// Throws Error kInvalidParameter whose fields begin with `prefix`.
MeshParameters parse_order_parameters(std::string_view rules, std::string_view own,
                                      const std::string& prefix);

}  // namespace isomesh
