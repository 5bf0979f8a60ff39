#pragma once

namespace meshtide {

// How much work a stream is worth: what high takes more of are contexts, geometry and time, in both directions.
enum class Effort { standard, high };

} // namespace meshtide
