using System;
using Troupe.Native;

namespace Troupe
{
    /// <summary>A call failed. The message says what to do about it.</summary>
    public sealed class TroupeException : Exception
    {
        /// <summary>The kind of error.</summary>
        public TroupeStatus Status { get; }
        /// <summary>The argument or field of the request that is at fault. Empty: none.</summary>
        public string Field { get; }
        /// <summary>Allowed values of the field. Empty: see the message.</summary>
        public string Allowed { get; }
        /// <summary>The server's word for the kind of error. Empty: none.</summary>
        public string Reason { get; }
        /// <summary>Id of the request, which the server's log lines show. Empty: none.</summary>
        public string RequestId { get; }

        private TroupeException(TroupeStatus status, string[] texts) : base(texts[0])
        {
            Status = status;
            Field = texts[1];
            Allowed = texts[2];
            Reason = texts[3];
            RequestId = texts[4];
        }

        /// <summary>Throws the last error of this thread if a call failed, and returns the status otherwise.</summary>
        internal static unsafe TroupeStatus Check(TroupeStatus status)
        {
            if (status >= 0) return status;
            var error = new TroupeError { size = (uint)sizeof(TroupeError) };
            Api.troupe_last_error(&error);
            throw new TroupeException(status, new[]
            {
                Texts.Read(error.message), Texts.Read(error.field), Texts.Read(error.allowed),
                Texts.Read(error.reason), Texts.Read(error.request_id)
            });
        }
    }
}
