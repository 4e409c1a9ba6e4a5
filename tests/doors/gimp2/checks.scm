; What the other scripts share. Pictures and facts go to the folder `scratch`, which the shell has defined, and `run`
; judges them. Each line of the file of facts is a name, a space, and a value.

(define (in-scratch name) (string-append scratch "/" name))
(define facts (open-output-file (in-scratch facts-name)))
(define (fact name value)
  (display name facts) (display " " facts) (display value facts) (newline facts))

; The program's stand-in reads there what it has to be.
(define (let-program-be kind)
  (let ((port (open-output-file (in-scratch "kind"))))
    (display kind port)
    (close-output-port port)))

(define (open-picture name)
  (car (file-png-load RUN-NONINTERACTIVE (in-scratch name) name)))
(define (layer-of image) (car (gimp-image-get-active-layer image)))
(define (keep drawable name)
  (file-png-save RUN-NONINTERACTIVE (car (gimp-item-get-image drawable)) drawable (in-scratch name) name
                 FALSE 1 FALSE FALSE FALSE FALSE TRUE))

; Calls the plug-in; each of `changed` is a list of an option and its value.
(define (lay image drawable . changed)
  (define (get option usual)
    (let ((found (assq option changed)))
      (if found (cadr found) usual)))
  (car (plug-in-smalti RUN-NONINTERACTIVE image drawable
                       (get 'style "mosaic") (get 'tiles 60) (get 'seed 7) (get 'mask "auto") (get 'grout "style")
                       (get 'grout-color '(128 128 128)) (get 'evals 6000) (get 'size 512) (get 'scale 1.0)
                       (get 'new-layer TRUE))))

; The sentence with which GIMP refuses to do it.
(define (refusal doing)
  (call-with-current-continuation
    (lambda (return)
      (let ((usual *error-hook*))
        (set! *error-hook*
          (lambda words
            (set! *error-hook* usual)
            (return (apply string-append (map (lambda (word) (if (string? word) word "")) words)))))
        (doing)
        (set! *error-hook* usual)
        "done without a refusal"))))

; Each picture stays alone: what it leaves behind would else be counted with the next.
(define (with-picture name doing)
  (let ((image (open-picture name)))
    (doing image (layer-of image))
    (gimp-image-delete image)))

(define (images-left name) (fact name (car (gimp-image-list))))
