// Orders: images of a PACS that become meshes which go back into it.
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
  kWaiting,    // until the series is in the PACS and does not grow any more
  kFetching,   // its instances are read
  kMeshing,    // its job is queued or runs
  kSending,    // what the job made goes to the PACS
  kSucceeded,  // everything is stored there
  kFailed,
  kCancelled,
};

// True for the three states that an order does not leave by itself.
bool is_final(OrderState state);

std::string_view to_string(OrderState value);
template <>
std::optional<OrderState> from_string(std::string_view name);

// A series of a configured PACS.
struct OrderSource {
  std::string pacs;  // its name
  std::string study;
  std::string series;
  std::optional<std::uint32_t> instances = {};  // once the series is known to be whole

  bool operator==(const OrderSource&) const = default;
};

// Where a mesh goes, and as what.
struct SendTarget {
  std::string pacs;
  MeshFormat format = MeshFormat::kStl;  // the only one that DICOM objects are made of

  bool operator==(const SendTarget&) const = default;
};

// One DICOM object for one PACS.
struct OrderResult {
  std::string pacs;
  MeshFormat format = MeshFormat::kStl;
  std::optional<std::int64_t> label = {};  // of an order by labels
  std::string series_uid;
  std::string sop_instance_uid;
  std::uint64_t bytes = 0;
  bool stored = false;  // the PACS has said so, and finds it

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
  std::optional<std::string> volume = {};  // once it has been fetched
  std::optional<std::string> job = {};
  std::vector<OrderResult> results;
  std::uint32_t attempts = 0;                    // that failed and are made again
  std::optional<std::string> next_attempt = {};  // RFC 3339, UTC, as all times
  std::string created;
  std::optional<std::string> finished = {};
  std::optional<Problem> error = {};  // why it failed, or what the last attempt met with

  bool operator==(const Order&) const = default;
};

// What the service keeps of an order besides: in its record, never in an answer.
struct OrderWork {
  std::vector<std::string> listed;          // SOP Instance UIDs of the series, ascending
  std::optional<std::string> listed_since;  // since when that is the list
  std::uint32_t failures = 0;               // in a row: how long the next pause is
  std::uint32_t looks = 0;                  // for a series that is not there, in a row
  std::string begun;                        // when the order was accepted, or tried anew
  std::optional<DicomIdentity> identity;    // of the images that were fetched
  std::vector<std::string> blobs;           // of the objects, in the order of the results
  std::string label;                        // what the mesh is called
  std::optional<std::int64_t> series_number;
  std::optional<std::string> callback;  // a URL
  // How far a mesh may be from the surface that is simplified to fit into what its PACS takes.
  std::optional<double> max_error_mm = {};
  std::optional<std::uint32_t> triangles = {};  // that fit, once it is known that all do not
  std::optional<std::string> queried = {};      // when the query of the audit trail was made
  // The step that has to succeed before the failures are forgotten. Empty: there were none.
  std::optional<OrderState> failed_in = {};

  bool operator==(const OrderWork&) const = default;
};

// What a client asks for. What it leaves out its rule says.
struct OrderRequest {
  OrderSource source;
  std::optional<std::string> rule;
  std::optional<std::string> parameters;  // as JSON, unchecked: parse_order_parameters reads it
  std::optional<std::vector<SendTarget>> send;
  std::optional<Priority> priority;
  std::optional<Callback> callback;
};

// How a PACS is, as far as is known since the service began.
struct PacsStatus {
  std::string name;
  std::optional<std::string> last_success = {};
  std::optional<std::string> last_failure = {};
  std::optional<std::string> reason = {};  // of that failure, in a word

  bool operator==(const PacsStatus&) const = default;
};

// A name for every UID that DICOM allows (PS3.5, 9.1): digits and dots, at most 64.
bool is_uid(std::string_view text);

std::string to_json(const Order& order);
// {"orders": [...], "next": cursor}
std::string to_json(const std::vector<Order>& orders, const std::string& next = "");
// {"pacs": [...]}
std::string to_json(const std::vector<PacsStatus>& pacs);
// What a callback tells: neither patients nor identifiers of DICOM.
std::string to_callback_json(const Order& order);
std::string to_json(const OrderRequest& request);

// Reads an answer of the server. Throws Error kInternal when it is not what the API says.
Order order_from_json(std::string_view text);
std::vector<Order> orders_from_json(std::string_view text);
std::vector<PacsStatus> pacs_from_json(std::string_view text);

// As a store keeps them. Reading fills in what an older version did not know; throws Error
// kInternal.
std::string to_record(const OrderWork& work);
Order order_from_record(std::string_view text);
OrderWork order_work_from_record(std::string_view text);

// Reads the body of POST /v1/orders. Throws Error kInvalidParameter that names what is wrong.
OrderRequest parse_order_request(std::string_view body);

// The parameters of an order's job: those of `own`, where it has them, and else of `rules`, both
// JSON objects as in POST /v1/jobs without `volume`, `priority` and `callback`; "" is none. Their
// formats are "stl" unless they say otherwise. Throws Error kInvalidParameter whose fields begin
// with `prefix`.
MeshParameters parse_order_parameters(std::string_view rules, std::string_view own,
                                      const std::string& prefix);

}  // namespace isomesh
